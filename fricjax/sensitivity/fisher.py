"""The Fisher information of a planned run: which coefficients it will determine, and to what standard error.

With white noise of standard deviation ``sigma`` the information matrix is ``J'J/sigma^2``, ``J`` the derivatives of the
reading, and its inverse bounds the covariance of any unbiased estimate (Cramer and Rao); a fit of the trace reaches it.
The bound knows nothing of calibration, floor motion or a law that is wrong: these decide the uncertainty of a real run.
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..errors import UsageError
from ..estimation.covariance import quadratic
from ..estimation.loss import Squares
from ..fitting.derived import UNITS, derive
from ..fitting.evaluation import evaluate
from ..oscillator import Oscillator
from ..oscillator.engines import AbstractEngine
from .directions import directions, spectrum
from .information import Information
from .local import checked_times
from .plan import Plan, course_of, creep_start, plan, planned_times
from .settings import check_noise

# Least number of samples to provide for.
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
    """What a planned run will tell of a machine, before it is made.

    The mass is released from rest at time zero. The number of half-cycles stays at its value, and under a law that
    creeps the samples after the last reversal are left out, as in a fit.

    Args:
        oscillator: the machine at the values that are expected.
        x0: displacement at release [m].
        ts: sample times [s], shape (samples,); None for `rate` and `duration`.
        names: coefficients to be fitted; None for all that the model has (a coefficient of zero is a term that it does
            not have, except damping), of which a single run never tells all.
        rate: samples per second.
        duration: length of the record [s]; None: until 50 ms after the stop.
        noise: standard deviation of the white noise of one sample [m].
        nuisance: free parameters of the run: x0, v0, offset, drift, t_release. A fit from the first reversal has x0,
            offset and t_release.
        engine: "auto", "exact", "hybrid", "smooth" or an engine.

    Returns:
        The expected standard errors, what is not determined in words, and advice on the run.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings that do not fit, or a mass that never stops without a `duration`.
    """
    check_noise(noise)
    course = course_of(oscillator, float(x0))
    times = planned_times(course, rate, duration) if ts is None else checked_times(ts)
    made = plan(oscillator, x0, times, names, nuisance, noise=noise, engine=engine, course=course)
    return _information(made, noise)


def _information(made: Plan, noise: float) -> Information:
    normal, scales, ts = _normal(made), made.scales, made.ts
    inverse = quadratic(np.zeros(scales.size), normal, np.zeros(scales.size, bool)).inverse
    spread = spectrum(normal)
    return Information(
        names=made.names,
        values=dict(zip(made.names, map(float, made.values), strict=True)),
        units={parameter.name: parameter.unit for parameter in made.parameters},
        matrix=normal / np.outer(scales, scales),
        inverse=inverse * np.outer(scales, scales),
        rank=spread.rank,
        condition=spread.condition,
        singular=directions(spread.null, made.parameters),
        slopes=_slopes(made),
        idle=tuple(name for name, active in zip(made.names, spread.active, strict=True) if not active),
        course=made.course,
        x0=made.x0,
        samples=ts.size,
        rate=float((ts.size - 1) / (ts[-1] - ts[0])),
        duration=float(ts[-1] - ts[0]),
        noise=noise,
        engine=engine_name(made),
        oscillator=made.oscillator,
    )


def _normal(made: Plan) -> np.ndarray:
    """The information matrix in coordinates, shape (p, p)."""
    residual, run = made.residual, made.residual.runs[0]
    count = int(np.sum(made.ts <= creep_start(made)))
    # Samples without weight fill up to a power of two, so that most runs share one compilation.
    filler = max(_FEWEST, 2 ** (count - 1).bit_length()) - count
    t, x, weight = (
        np.pad(np.asarray(values)[:count], (0, filler), mode="edge") for values in (run.t, run.x, run.weight)
    )
    weight[count:] = 0.0
    residual = dataclasses.replace(residual, runs=(dataclasses.replace(run, t=t, x=x, weight=weight),))
    normal = np.asarray(evaluate(residual, jnp.zeros(len(made.parameters)), Squares()).normal)
    lost = [name for name, size in zip(made.names, np.diag(normal), strict=True) if not np.isfinite(size)]
    if lost:
        raise UsageError(
            f"The derivatives of the motion with respect to {', '.join(lost)} are not finite under the "
            f"{engine_name(made)} engine. Check the law's coefficients, or choose another engine."
        )
    return normal


def engine_name(made: Plan) -> str:
    """The engine as its users name it."""
    return type(made.residual.engine).__name__.lower()


def _slopes(made: Plan) -> dict[str, tuple[float, str, dict[str, float]]]:
    """Quantities in which the common scale of mass, stiffness and load drops out, with their derivatives."""
    settled = eqx.filter_jit(derive)(made.residual, jnp.zeros(len(made.parameters)))
    rows = zip(UNITS.items(), settled.kinematics, settled.by_value, strict=True)
    return {
        name: (float(value), unit, dict(zip(made.names, map(float, slope), strict=True)))
        for (name, unit), value, slope in rows
        if float(value) and np.any(slope)
    }
