"""The release: decay of the holding force.

It is fitted to the samples before the first reversal. A magnet takes a few milliseconds to release the mass. This
lowers the first amplitude and delays the motion: by 0.3 % and about 1 ms for a time constant of 1 ms at 12.6 Hz. It
biases evaluations that use the initial displacement, but not a fit from the first reversal on. With the machine known
from such a fit, the earlier samples determine the release.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..data.gather import record_of
from ..data.record import check_displacement
from ..errors import DataError, UsageError, check_type
from ..fitting import Fit
from ..oscillator import ExponentialRelease, simulate
from .result import Estimates

_UNITS = {"time_constant": "s", "t_release": "s", "x0": "m"}
# Fewest samples before the first reversal that determine three parameters and their scatter.
_LEAST = 8
# Start value of the time constant [s]: that of a small electromagnet.
_TYPICAL = 1e-3
# Error of the integration [m]: far below the noise of any interferometer.
_ACCURACY = 1e-11


def fit_release(data: Any, fit: Fit) -> Estimates:
    """Fit time constant, time and start displacement of a release.

    Args:
        data: the run, as for :func:`fricjax.fit`, from before its release or from early in its first half-cycle.
        fit: its fit from the first reversal on; machine and offset are taken as exact.

    Returns:
        ``time_constant`` [s] of ``exp(-t/time_constant)``, ``t_release`` [s] in the time of the record, and ``x0`` [m],
        the displacement of the held mass from the equilibrium.

    Raises:
        UsageError: a law without a jump at rest.
        DataError: too few samples before the first reversal, or a mass that would stay at its initial displacement.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(
        ...     machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, hold=5e-3, release_time_constant=2e-3, seed=0
        ... )
        >>> from_reversal = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> round(1e3 * fj.fit_release(run, from_reversal).values["time_constant"], 3)
        2.0
    """
    from scipy.optimize import least_squares

    record = record_of(data)
    check_displacement(record, "the force of the release")
    check_type("fit", fit, Fit, "the Fit of fricjax.fit")
    machine, offset, segmentation = fit.oscillator, fit.run_parameter("offset"), record.segmentation
    if not segmentation.turning_times.size:
        raise DataError("The record has no reversal, so there is no first half-cycle to evaluate.")
    first_reversal = float(segmentation.turning_times[0])
    used = record.mask & (record.t < first_reversal)
    if used.sum() < _LEAST:
        raise DataError(
            f"Only {int(used.sum())} samples lie before the first reversal, and at least {_LEAST} are needed. Record "
            "the run from before its release."
        )
    if not machine.friction.set_valued:
        raise UsageError(f"fit_release needs a set-valued law such as Coulomb, got {type(machine.friction).__name__}.")
    noise = np.broadcast_to(segmentation.noise if record.sigma is None else record.sigma, record.t.shape)
    t, x, sigma = record.t[used], record.x[used], np.maximum(noise[used], 1e-13)
    half_period = np.pi / float(machine.angular_frequency)
    begin = np.array([np.log(_TYPICAL), first_reversal - half_period - _TYPICAL, x[0] - offset])

    def residual(p: Any) -> Any:
        log_decay, t_release, x0 = p
        release = ExponentialRelease(jnp.exp(log_decay))
        motion = simulate(machine, x0, t - t_release, release=release, accuracy=_ACCURACY)
        return (motion.x + offset - x) / sigma

    jacobian = jax.jacfwd(residual)

    scale = np.array([1.0, 1e-3, abs(begin[2])])
    solved = least_squares(
        lambda p: np.asarray(residual(p)),
        begin,
        jac=lambda p: np.asarray(jacobian(jnp.asarray(p))),  # pyright: ignore[reportArgumentType]
        x_scale=scale,
        method="lm",
    )
    if not np.all(np.isfinite(solved.jac)) or np.linalg.matrix_rank(solved.jac) < begin.size:
        raise DataError(
            "The samples before the first reversal do not determine the release. Record the run from before it, and "
            "check the fit that was passed."
        )
    values, slope = solved.x.copy(), np.array([np.exp(solved.x[0]), 1.0, 1.0])
    values[0] = slope[0]
    covariance = np.linalg.inv(solved.jac.T @ solved.jac) * np.outer(slope, slope)
    return Estimates.of(_UNITS, values, covariance, float(2 * solved.cost / max(t.size - begin.size, 1)))
