"""Modal calibration: moving mass, stiffness and damping from a measured receptance X/F.

A hammer with a force sensor strikes the mass, the interferometer watches, and the ratio of the two spectra is the
receptance ``X/F = 1/(k - m w^2 + i w c)``. Two methods evaluate it: least squares on all lines of the spectrum, the
result, and peak picking, its check.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import DataError
from ..rig.measured import Measured
from ..rig.propagate import positive
from .modal import Modal, fit_mode
from .modal_calibration import ModalCalibration
from .peaks import NAMES, SCALED, pick, picking_error

_LEAST_LINES = 8
_BANDWIDTHS = 5.0
_APART = 5.0


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
    """
    f, response = _lines(frequency, receptance)
    length = 1 / float(np.median(np.diff(f))) if duration is None else positive("duration", "s", duration).value
    scale = Measured(1.0, scale_std).std
    picked = pick(f, response)
    fitted = fit_mode(f, response, picked)
    best: dict[str, Measured] = {name: fitted.measured(name, scale) for name in NAMES}
    errors = picking_error(f, fitted.fitted, fitted.line_noise, fitted.numbers)
    peaks: dict[str, Measured] = dict(zip(NAMES, map(Measured, picked.numbers(), errors), strict=True))
    apart = _apart(best, peaks)
    return ModalCalibration(
        **best,
        peak_picking={name: _with_scale(name, number, scale) for name, number in peaks.items()},
        residual_compliance=fitted.residual_compliance,
        noise=_noise_at_resonance(fitted),
        duration=length,
        warnings=(*_short(length, best), *apart),
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


def _with_scale(name: str, number: Measured, scale_std: float) -> Measured:
    """A picked number with the uncertainty of the receptance's scale, where it depends on that."""
    share = scale_std * number.value if name in SCALED else 0.0
    return Measured(number.value, math.hypot(number.std, share))


def _noise_at_resonance(fitted: Modal) -> float:
    peak = int(np.argmax(np.abs(fitted.fitted)))
    return float(fitted.line_noise[peak] / np.abs(fitted.fitted[peak]))


def _short(duration: float, best: Mapping[str, Measured]) -> list[str]:
    """A record must outlast the ringing, or leakage broadens the resonance."""
    needed = _BANDWIDTHS / (2 * best["damping_ratio"].value * best["frequency"].value)
    if duration >= needed:
        return []
    return [
        f"The record of {duration:.3g} s is too short for this damping, which asks for {needed:.3g} s, 5/(2 zeta f_n): "
        "leakage falsifies damping, stiffness and mass by more than their uncertainties say. Record longer, or take "
        "frequency and damping ratio from a ring-down."
    ]


def _apart(best: Mapping[str, Measured], peaks: Mapping[str, Measured]) -> list[str]:
    """Two methods that disagree by more than peak picking scatters see something else than one mode."""
    apart = [name for name in NAMES if abs(best[name].value - peaks[name].value) > _APART * peaks[name].std]
    if not apart:
        return []
    return [
        f"Least squares and peak picking disagree on {', '.join(apart)}: the receptance is not that of one mode. "
        "Look for leakage, an exponential window, or a band with a second mode or lines that the hammer did not excite."
    ]
