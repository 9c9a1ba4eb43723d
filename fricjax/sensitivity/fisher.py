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
from ..oscillator import Oscillator, simulate
from ..oscillator.engines import AbstractEngine
from ..settings import check_noise
from .advice import errors_of, warnings_of
from .directions import directions, spectrum
from .information import Information
from .plan import Plan, checked_times, plan, planned_motion, planned_times
from .ridge import combinations

# Room for at least so many samples: the size is part of a program, and runs of one size share their compilation.
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
    """What a planned run will determine of a machine, before it is made.

    The mass is released from rest at time zero. The number of half-cycles stays at its value, and under a law that
    creeps the samples after the last reversal are left out, as in a fit.

    Args:
        oscillator: the machine at the values that are expected.
        x0: displacement at release [m].
        ts: sample times [s], shape (samples,); None for `rate` and `duration`.
        names: coefficients to be fitted; None for all that the model has (a coefficient of zero is a term that it does
            not have, except damping), of which a single run never determines all.
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

    Examples:
        One half-cycle shows only its centre, several determine friction to parts in ten million:

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
    motion = planned_motion(oscillator, float(x0))
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
    """The information matrix in coordinates, shape (p, p)."""
    residual, run, law = planned.residual, planned.residual.runs[0], planned.oscillator.friction
    count = planned.ts.size
    if not (law.set_valued or law.n_states or residual.engine.needs_mesh):
        # A regularised law lets the mass creep after its last reversal, and a fit leaves these samples out.
        motion = simulate(planned.oscillator, planned.x0, planned.ts[-1:], engine=residual.engine)
        count = int(np.sum(planned.ts <= float(motion.stats["t_handover"])))
    # Samples without weight fill up to a power of two, so that most runs share one compilation.
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
    """Quantities in which the common scale of mass, stiffness and load drops out, with their derivatives."""
    derived = eqx.filter_jit(derive)(planned.residual, jnp.zeros(len(planned.parameters)))
    rows = zip(UNITS.items(), derived.kinematics, derived.by_value, strict=True)
    return {
        name: (float(value), unit, dict(zip(planned.names, map(float, slope), strict=True)))
        for (name, unit), value, slope in rows
        if float(value) and np.any(slope)
    }
