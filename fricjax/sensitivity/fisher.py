"""Fisher information of a planned run, and the expected standard errors.

With white noise of standard deviation ``sigma`` the information matrix is ``J'J/sigma^2``, with the derivatives ``J``
of the reading. Its inverse bounds the covariance of any unbiased estimate (Cramer and Rao), and a fit of the trace
reaches this bound. The bound does not include calibration, floor motion or a wrong law, which dominate the uncertainty
of a real run.
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..errors import UsageError, check_type
from ..estimation.covariance import quadratic
from ..estimation.loss import Squares
from ..fitting.derived import UNITS, derive
from ..fitting.evaluation import evaluate
from ..numbers import scalar
from ..oscillator import Oscillator, simulate
from ..oscillator.engines import AbstractEngine
from ..settings import check_noise
from .advice import errors_of, warnings_of
from .directions import directions, spectrum
from .information import Information
from .plan import Plan, checked_times, plan, planned_motion, planned_times
from .ridge import combinations

# Least number of samples after padding. Runs of one padded size share a compiled program.
_FEWEST = 4096


def fisher(
    oscillator: Oscillator,
    x0: float,
    ts: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    *,
    rate: float = 10e3,
    duration: float | None = None,
    noise: float = 1e-9,
    nuisance: Sequence[str] = ("x0", "offset"),
    engine: str | AbstractEngine = "auto",
) -> Information:
    """Return the information of a planned run about a machine.

    The mass is released from rest at time zero. The number of half-cycles is constant. Under a law that creeps, the
    samples after the last reversal are left out, as in a fit.

    Args:
        oscillator: the machine at the expected values.
        x0: displacement at release [m].
        ts: sample times [s], shape (samples,); None for `rate` and `duration`.
        names: coefficients to fit; None: all coefficients of the model that are not zero, and damping. A single run
            never determines all of these.
        rate: samples per second.
        duration: length of the record [s]; None: until 50 ms after the stop.
        noise: standard deviation of the white noise of one sample [m].
        nuisance: free parameters of the run: x0, v0, offset, drift, t_release. A fit from the first reversal has x0,
            offset and t_release.
        engine: "auto", "exact", "hybrid", "smooth" or an engine.

    Returns:
        The expected standard errors, the undetermined directions in words, and advice on the run.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings are not valid, or the mass never stops and there is no `duration`.

    Examples:
        One half-cycle determines only its centre. Several determine friction to 1e-7:

        >>> import fricjax as fj
        >>> oscillator = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> information = fj.sensitivity.fisher(oscillator, 1e-3, names=["mu", "stiffness"])
        >>> print(f"{information.std_errors['mu'] / 0.05:.0e}")
        1e-07
        >>> short = fj.sensitivity.fisher(oscillator, 0.5e-3, names=["mu", "stiffness"])
        >>> short.undetermined
        ('mu', 'x0', 'offset')
    """
    check_noise(noise)
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    motion = planned_motion(oscillator, scalar("x0", x0))
    times = planned_times(motion, rate, duration) if ts is None else checked_times(ts)
    planned = plan(oscillator, x0, times, names, nuisance, noise=noise, engine=engine, motion=motion)
    normal, scales, parameters = _normal(planned), planned.scales, planned.parameters
    inverse, spread = quadratic(np.zeros(scales.size), normal, np.zeros(scales.size, bool)).inverse, spectrum(normal)
    information = Information(
        names=planned.names,
        values={parameter.name: float(parameter.start) for parameter in parameters},
        units={parameter.name: parameter.unit for parameter in parameters},
        matrix=normal / np.outer(scales, scales),
        inverse=inverse * np.outer(scales, scales),
        rank=spread.rank,
        condition=spread.condition,
        singular=directions(spread.null, parameters),
        slopes=_slopes(planned),
        no_effect=tuple(name for name, active in zip(planned.names, spread.active, strict=True) if not active),
        motion=motion,
        x0=planned.x0,
        samples=times.size,
        rate=float((times.size - 1) / (times[-1] - times[0])),
        duration=float(times[-1] - times[0]),
        noise=noise,
        engine=_engine_name(planned),
        oscillator=planned.oscillator,
    )
    return dataclasses.replace(
        information,
        combinations=combinations(information),
        errors=tuple(errors_of(information)),
        warnings=tuple(warnings_of(information)),
    )


def _normal(planned: Plan) -> np.ndarray:
    """Return the information matrix in coordinates, shape (p, p)."""
    residual, run, law = planned.residual, planned.residual.runs[0], planned.oscillator.friction
    count = planned.ts.size
    if not (law.set_valued or law.n_states or residual.engine.needs_mesh):
        # Under a regularised law the mass creeps after its last reversal. A fit leaves these samples out.
        motion = simulate(planned.oscillator, planned.x0, planned.ts[-1:], engine=residual.engine)
        count = int(np.sum(planned.ts <= float(motion.stats["t_handover"])))
    # Samples of zero weight pad the run to a power of two, so that most runs share one compiled program.
    filler = max(_FEWEST, 2 ** (count - 1).bit_length()) - count
    t, x, weight = (
        np.pad(np.asarray(values)[:count], (0, filler), mode="edge") for values in (run.t, run.x, run.weight)
    )
    weight[count:] = 0.0
    residual = residual.with_runs(t=[t], x=[x], weight=[weight])
    normal = np.asarray(evaluate(residual, jnp.zeros(len(planned.parameters)), Squares()).normal)
    lost = [name for name, size in zip(planned.names, np.diag(normal), strict=True) if not np.isfinite(size)]
    if lost:
        raise UsageError(
            f"The derivatives of the motion with respect to {', '.join(lost)} are not finite under the "
            f"{_engine_name(planned)} engine. Check the law's coefficients, or choose another engine."
        )
    return normal


def _engine_name(planned: Plan) -> str:
    return type(planned.residual.engine).__name__.lower()


def _slopes(planned: Plan) -> dict[str, tuple[float, str, dict[str, float]]]:
    """Return quantities that need no rig, with their units and derivatives."""
    derived = eqx.filter_jit(derive)(planned.residual, jnp.zeros(len(planned.parameters)))
    rows = zip(UNITS.items(), derived.kinematics, derived.by_value, strict=True)
    return {
        name: (float(value), unit, dict(zip(planned.names, map(float, slope), strict=True)))
        for (name, unit), value, slope in rows
        if float(value) and np.any(slope)
    }
