"""How the mass was let go: the decay of the holding force, from the samples before the first reversal.

A magnet takes a few milliseconds to let go. That lowers the first amplitude and delays the motion, by 0.3 % and about
1 ms for a time constant of 1 ms at 12.6 Hz, and biases whatever starts from the initial displacement. A fit from the
first reversal on does not see it; with the machine known from there, the samples before tell how the release went.
"""

from typing import Any

import numpy as np

from ..data import Record
from ..data.gather import record_of
from ..errors import DataError, UsageError
from ..fitting import Fit
from ..oscillator import ExponentialRelease, Oscillator, driven_motion
from .estimates import Estimates

_UNITS = {"time_constant": "s", "t_release": "s", "x0": "m"}
_LEAST = 8
# Start value of the time constant [s]; steps of the finite differences: far above the error of the integration.
_TYPICAL, _STEPS, _ACCURACY = 1e-3, np.array([1e-3, 1e-6, 1e-9]), 1e-11


def fit_release(data: Any, found: Fit) -> Estimates:
    """Time constant of the holding force, moment of the release and held displacement.

    Args:
        data: the run, given as to :func:`fricjax.fit`, from before its release or from early in its first stroke.
        found: its fit from the first reversal on, whose machine and offset are taken as exact.

    Returns:
        ``time_constant`` [s] of ``exp(-t/time_constant)``, ``t_release`` [s] in the time of the record, and ``x0`` [m],
        the displacement from the equilibrium at which the mass was held.

    Raises:
        UsageError: a law without a jump at rest.
        DataError: too few samples before the first reversal, or a mass that would not leave its held displacement.

    ```python
    fricjax.fit_release("run.csv", fricjax.fit("run.csv", oscillator, ["mu", "damping", "stiffness"]))
    ```
    """
    from scipy.optimize import least_squares

    t, x, sigma, turned = _first_stroke(record_of(data))
    machine, offset = found.oscillator, found.run_parameter("offset")
    if not machine.friction.set_valued:
        raise UsageError(f"fit_release needs a set-valued law such as Coulomb, got {type(machine.friction).__name__}.")
    half_period = np.pi / float(machine.angular_frequency)
    begin = np.array([np.log(_TYPICAL), turned - half_period - _TYPICAL, x[0] - offset])

    def residual(p: np.ndarray) -> np.ndarray:
        return (_released(machine, t, *p) + offset - x) / sigma

    def jacobian(p: np.ndarray) -> np.ndarray:
        ends = ((residual(p + step) - residual(p - step)) / (2 * np.sum(step)) for step in np.diag(_STEPS))
        return np.stack(list(ends), axis=1)

    scale = np.array([1.0, 1e-3, abs(begin[2])])
    solved = least_squares(residual, begin, jac=jacobian, x_scale=scale, method="lm")  # pyright: ignore
    if not np.all(np.isfinite(solved.jac)) or np.linalg.matrix_rank(solved.jac) < begin.size:
        raise DataError(
            "The samples before the first reversal do not tell the release. Record the run from before it, and check "
            "the fit that was given."
        )
    values, slope = solved.x.copy(), np.array([np.exp(solved.x[0]), 1.0, 1.0])
    values[0] = slope[0]
    covariance = np.linalg.inv(solved.jac.T @ solved.jac) * np.outer(slope, slope)
    return Estimates.of(_UNITS, values, covariance, float(2 * solved.cost / max(t.size - begin.size, 1)))


def _released(machine: Oscillator, t: np.ndarray, log_decay: float, t_release: float, x0: float) -> np.ndarray:
    """Displacement from the equilibrium at `t` [m]."""
    release = ExponentialRelease(np.exp(log_decay))
    return driven_motion(machine, x0, t - t_release, release=release, accuracy=_ACCURACY).x


def _first_stroke(record: Record) -> tuple[Any, ...]:
    """Times, displacements and noise before the first reversal, and the time of that reversal."""
    t, x, shape = record.t, record.x, record.segmentation
    if not shape.turning_times.size:
        raise DataError("The record holds no reversal, so there is no first stroke to look at.")
    turned = float(shape.turning_times[0])
    used = record.mask & (t < turned)
    if used.sum() < _LEAST:
        raise DataError(
            f"Only {int(used.sum())} samples lie before the first reversal, and at least {_LEAST} are needed. Record "
            "the run from before its release."
        )
    noise = np.broadcast_to(shape.noise if record.sigma is None else record.sigma, t.shape)
    return t[used], x[used], np.maximum(noise[used], 1e-13), turned
