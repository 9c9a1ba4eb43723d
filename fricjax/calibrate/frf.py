"""Modal calibration: moving mass, stiffness and damping from a measured receptance X/F.

A hammer with a force sensor strikes the mass, the interferometer watches, and the ratio of the two spectra is the
receptance ``X/F = 1/(k - m w^2 + i w c)``. Two methods evaluate it: least squares on all lines of the spectrum, the
result, and peak picking, its check.
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
# Sixteen numbers for the four of a mode, so that what is left over tells the noise.
_LEAST_LINES = 8
# Lines that the half-power bandwidth, 2 zeta f_n, must hold at least; with fewer, leakage broadens the resonance.
_BANDWIDTHS = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class ModalCalibration(Reported):
    """A calibrated mode. The standard uncertainties hold the scatter of the lines and that of the receptance's scale.

    Attributes:
        mass: moving mass [kg].
        stiffness: stiffness [N/m].
        damping: viscous coefficient [N s/m].
        frequency: undamped natural frequency [Hz].
        damping_ratio: fraction of the critical damping [1].
        peak_picking: the same five by name, by peak picking.
        residual_compliance: compliance of the modes above the band [m/N].
        noise: standard deviation of the line at the resonance over its size [1].
        duration: length of the record [s].
        lines: frequencies of the spectrum [Hz], shape (n,).
        receptance: complex X/F that was measured at the lines [m/N], shape (n,).
        fitted: that of the mode, shape (n,).
        warnings: what a reader of the numbers must know, in sentences.

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
        """The rig with the calibrated mass, frequency and damping ratio, whose errors are nearly independent.

        Args:
            normal_force: load on the contact [N].
            **others: further arguments of `Rig`, such as `restoring` or `drag`.

        Raises:
            UsageError: a value that no rig has.
        """
        known = {"mass": self.mass, "frequency": self.frequency, "damping_ratio": self.damping_ratio}
        return Rig(**{**known, "normal_force": normal_force, **others})

    def numbers(self) -> dict[str, Measured]:
        """The five results of least squares by name."""
        return {name: getattr(self, name) for name in NAMES}

    def report(self) -> Report:
        """Both methods in one table, and the warnings."""
        rows = [(name, number, self.peak_picking[name], UNITS[name]) for name, number in self.numbers().items()]
        title = f"Modal calibration from a record of {spoken(self.duration)}"
        table = Table(("quantity", "least squares", "peak picking", "unit"), rows, title)
        data = {name: value for name, value in vars(self).items() if name not in ("lines", "receptance", "fitted")}
        return Report([table], warnings=self.warnings, data=data)

    def thumbnails(self) -> Sequence[str]:
        sizes = [Curve(self.lines, np.abs(values)) for values in (self.receptance, self.fitted)]
        return [curves_svg(sizes, ("Frequency", "Hz"), ("Receptance", "m/N"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Size and phase of the receptance, measured and of the mode, as a matplotlib figure.

        Args:
            style: as of :func:`fricjax.show.styled`.
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
    """Read a receptance from a text table, as analysers export it.

    Args:
        path: a file whose first three columns are frequency, real and imaginary part; delimiter and header are
            detected, and units stand in the header as in ``Re [um/N]``, else they are Hz and m/N.

    Returns:
        Frequencies [Hz], shape (n,), and the complex receptance [m/N], shape (n,).

    Raises:
        DataError: no such file, no such table, or a unit that does not fit.
    """
    frequency, real, imaginary = read_table(path, _COLUMNS, what="a receptance").values()
    return frequency, real + 1j * imaginary


def calibrate_frf(
    frequency: Any, receptance: Any, *, duration: float | None = None, scale_std: float = 0.0
) -> ModalCalibration:
    """Mass, stiffness and damping from a receptance around its resonance.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,), increasing, n >= 8.
        receptance: complex displacement over force X/F [m/N], shape (n,), of negative imaginary part.
        duration: length of the record [s] that the spectrum was computed from; None: one over the spacing of the
            lines, as without zero padding.
        scale_std: relative standard uncertainty of the scale of the receptance, that of the force sensor above all. No
            scatter shows it, and mass, stiffness and damping bear it in full.

    Returns:
        The calibration by complex least squares, with peak picking beside it.

    Raises:
        DataError: arrays that are no receptance, or one without a resonance well inside the band.
        UsageError: a duration that is not positive, or a negative scale_std.

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
    # The scale of the receptance is common to both methods, so that their difference is compared without it.
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
    """The lines as arrays, or one sentence on what is wrong with them."""
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
