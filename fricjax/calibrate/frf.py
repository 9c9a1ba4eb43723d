"""Modal calibration: moving mass, stiffness and damping from a measured receptance X/F.

A hammer with a force sensor strikes the mass, and the interferometer records the displacement. The ratio of the two
spectra is the receptance ``X/F = 1/(k - m w^2 + i w c)``. Least squares on all lines of the spectrum give the result.
Peak picking checks it.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import thresholds
from ..data.table import read_table
from ..errors import DataError
from ..instrument.run import not_negative
from ..rig.measured import Measured, positive
from ..rig.quantity import UNITS
from ..rig.rig import Number, Rig
from ..show import Report, Reported, Style, Table, axis_label, display_unit, figure, styled
from ..show.numbers import duration as spoken
from ..show.thumbnail import Curve, curves_svg
from .modal import fit_mode
from .peaks import NAMES, SCALED, pick, picking_error

# Columns of a text table as analysers export them.
_COLUMNS = {"frequency": "Hz", "real part": "m/N", "imaginary part": "m/N"}
# Eight complex lines are sixteen numbers for the four parameters of a mode; the residuals then determine the noise.
_LEAST_LINES = 8
# Minimum number of lines within the half-power bandwidth 2 zeta f_n; with fewer, leakage broadens the resonance.
_BANDWIDTHS = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class ModalCalibration(Reported):
    """Result of a modal calibration.

    The standard uncertainties include the scatter of the lines and the uncertainty of the scale of the receptance.

    Attributes:
        mass: moving mass [kg].
        stiffness: stiffness [N/m].
        damping: viscous coefficient [N s/m].
        frequency: undamped natural frequency [Hz].
        damping_ratio: fraction of the critical damping [1].
        peak_picking: the same five quantities by name, from peak picking.
        residual_compliance: compliance of the modes above the band [m/N].
        noise: relative standard deviation of the line at the resonance [1].
        duration: length of the record [s].
        lines: frequencies of the spectrum [Hz], shape (n,).
        receptance: measured complex X/F at the lines [m/N], shape (n,).
        fitted: fitted receptance of the mode [m/N], shape (n,).
        warnings: warnings, each a sentence or more.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> frequency = np.linspace(10.0, 15.0, 401)
        >>> omega = 2 * np.pi * frequency
        >>> receptance = 1 / (2574.0 - 0.41 * omega**2 + 0.18j * omega)
        >>> calibration = fj.calibrate_frf(frequency, receptance)
        >>> round(calibration.rig(normal_force="9.66(5) N").mass.value, 6)
        0.41
    """

    mass: Measured
    stiffness: Measured
    damping: Measured
    frequency: Measured
    damping_ratio: Measured
    peak_picking: Mapping[str, Measured]
    residual_compliance: Measured
    noise: float
    duration: float
    lines: np.ndarray
    receptance: np.ndarray
    fitted: np.ndarray
    warnings: tuple[str, ...]

    def rig(self, normal_force: Number, **others: Any) -> Rig:
        """Build a rig with the calibrated mass, frequency and damping ratio.

        The errors of these three quantities are nearly independent.

        Args:
            normal_force: load on the contact [N].
            **others: further arguments of `Rig`, such as `restoring` or `drag`.

        Raises:
            UsageError: a value is impossible.
        """
        known = {"mass": self.mass, "frequency": self.frequency, "damping_ratio": self.damping_ratio}
        return Rig(**{**known, "normal_force": normal_force, **others})

    def numbers(self) -> dict[str, Measured]:
        """Results of least squares by name."""
        return {name: getattr(self, name) for name in NAMES}

    def report(self) -> Report:
        """Report both methods in one table, with the warnings."""
        rows = [(name, number, self.peak_picking[name], UNITS[name]) for name, number in self.numbers().items()]
        title = f"Modal calibration from a record of {spoken(self.duration)}"
        table = Table(("quantity", "least squares", "peak picking", "unit"), rows, title)
        data = {name: value for name, value in vars(self).items() if name not in ("lines", "receptance", "fitted")}
        return Report([table], warnings=self.warnings, data=data)

    def thumbnails(self) -> Sequence[str]:
        sizes = [Curve(self.lines, np.abs(values)) for values in (self.receptance, self.fitted)]
        return [curves_svg(sizes, ("Frequency", "Hz"), ("Receptance", "m/N"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot magnitude and phase of the receptance, measured and fitted.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure(2, 1, share_x=True, heights=(5, 3))
        top, bottom = axes[:, 0]
        factor, unit = display_unit(float(np.max(np.abs(self.fitted))), "m/N")
        for values, mark, label in ((self.receptance, ".", "measured"), (self.fitted, "-", "mode")):
            top.plot(self.lines, factor * np.abs(values), mark, label=label)
            bottom.plot(self.lines, np.degrees(np.unwrap(np.angle(values))), mark)
        top.set_yscale("log")
        top.set_ylabel(axis_label("Receptance", unit))
        top.legend(loc="upper right", fontsize=8)
        bottom.set_ylabel(axis_label("Phase", "deg"))
        bottom.set_xlabel(axis_label("Frequency", "Hz"))
        drawing.align_ylabels()
        return styled(drawing, style)


def read_frf(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a receptance from a text table, as exported by analysers.

    Args:
        path: a file with the columns frequency, real part and imaginary part. Delimiter and header are detected. The
            header may contain units, as in ``Re [um/N]``; the default units are Hz and m/N.

    Returns:
        Frequencies [Hz], shape (n,), and the complex receptance [m/N], shape (n,).

    Raises:
        DataError: the file is missing or contains no such table, or a unit does not fit.
    """
    frequency, real, imaginary = read_table(path, _COLUMNS, what="a receptance").values()
    return frequency, real + 1j * imaginary


def calibrate_frf(
    frequency: Any, receptance: Any, *, duration: float | None = None, scale_std: float = 0.0
) -> ModalCalibration:
    """Estimate mass, stiffness and damping from a receptance around its resonance.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,), increasing, n >= 8.
        receptance: complex displacement over force X/F [m/N], shape (n,), with negative imaginary part.
        duration: length of the record of the spectrum [s]; None: one over the spacing of the lines, which is right
            without zero padding.
        scale_std: relative standard uncertainty of the scale of the receptance [1], mainly that of the force sensor. It
            does not appear in the scatter. Mass, stiffness and damping have this uncertainty in full.

    Returns:
        The calibration by complex least squares, and peak picking for comparison.

    Raises:
        DataError: the arrays are not a receptance, or there is no resonance well inside the band.
        UsageError: the duration is not positive, or scale_std is negative.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.calibrate.receptance import receptance
        >>> test = fj.instrument.impact_test(0.41, 2574.0, 0.18, duration=40.0, rate=2000.0, noise=1e-3)
        >>> calibration = fj.calibrate_frf(*receptance(test, band=(8.0, 18.0)))
        >>> print(f"{calibration.frequency.value:.2f} Hz, {calibration.mass.value:.2f} kg")
        12.61 Hz, 0.41 kg
    """
    f, response = _lines(frequency, receptance)
    length = 1 / float(np.median(np.diff(f))) if duration is None else positive("duration", "s", duration).value
    scale = not_negative("scale_std", scale_std, "")
    picked = pick(f, response)
    mode = fit_mode(f, response, picked)
    best: dict[str, Measured] = {name: mode.measured(name, scale) for name in NAMES}
    errors = picking_error(f, mode.fitted, mode.line_noise, mode.numbers)
    peaks: dict[str, Measured] = dict(zip(NAMES, map(Measured, picked.numbers(), errors), strict=True))

    warnings = []
    needed = _BANDWIDTHS / (2 * best["damping_ratio"].value * best["frequency"].value)
    if length < needed:
        warnings.append(
            f"The record of {length:.3g} s is too short for this damping, which asks for {needed:.3g} s, "
            "5/(2 zeta f_n): leakage falsifies damping, stiffness and mass by more than their uncertainties say. "
            "Record longer, or take frequency and damping ratio from a ring-down."
        )
    # Both methods have the same scale of the receptance, so the comparison excludes its uncertainty.
    apart = [name for name in NAMES if abs(best[name].value - peaks[name].value) > thresholds.SURE * peaks[name].std]
    if apart:
        warnings.append(
            f"Least squares and peak picking disagree on {', '.join(apart)}: the receptance is not that of one mode. "
            "Look for leakage, an exponential window, or a band with a second mode or lines that the hammer did not "
            "excite."
        )

    for name in SCALED:
        number = peaks[name]
        peaks[name] = Measured(number.value, math.hypot(number.std, scale * number.value))
    resonance = int(np.argmax(np.abs(mode.fitted)))
    return ModalCalibration(
        **best,
        peak_picking=peaks,
        residual_compliance=mode.residual_compliance,
        noise=float(mode.line_noise[resonance] / np.abs(mode.fitted[resonance])),
        duration=length,
        lines=f,
        receptance=response,
        fitted=mode.fitted,
        warnings=tuple(warnings),
    )


def _lines(frequency: Any, receptance: Any) -> tuple[np.ndarray, np.ndarray]:
    """Convert the lines to arrays, and check them."""
    try:
        f, response = np.asarray(frequency, dtype=float), np.asarray(receptance, dtype=complex)
    except (TypeError, ValueError) as error:
        raise DataError(f"frequency and receptance must hold numbers, but could not be converted: {error}.") from error
    if f.ndim != 1 or f.shape != response.shape or f.size < _LEAST_LINES:
        raise DataError(
            f"frequency and receptance must be equally long rows of at least {_LEAST_LINES} lines, got shapes "
            f"{f.shape} and {response.shape}."
        )
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(response))):
        raise DataError("frequency and receptance must be finite. Leave out the lines that are not.")
    if not (f[0] >= 0 and np.all(np.diff(f) > 0)):
        raise DataError("frequency must increase from line to line, from zero or more on. Sort the lines.")
    if not np.any(np.imag(response)):
        raise DataError("The receptance is real. Give the complex ratio X/F, not its magnitude.")
    return f, response
