"""Least-squares estimate as a pure function, for the transformations of JAX."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from ..data.observation import Observation, observed_as
from ..errors import UsageError, check_choice, check_type
from ..estimation.levenberg_marquardt import LevenbergMarquardt
from ..estimation.passes import residual_and_jacobian
from ..numbers import real
from ..oscillator.engines.base import AbstractEngine
from ..oscillator.observed import observe
from ..oscillator.oscillator import Oscillator, leaves_of
from ..oscillator.select import half_cycle_capacity, select_engine
from ..oscillator.session import ready
from ..oscillator.simulate import motion_of
from ..thresholds import SURE
from .names import chosen

_NUISANCES = ("x0", "v0", "offset", "drift")
# The derivatives hold at the optimum, so the last step is far below a standard error.
_TOLERANCE = 1e-5


class Estimate(eqx.Module):
    """Result of :func:`estimate`; a pytree of arrays.

    Attributes:
        values: estimates by name, in SI units.
        std_errors: standard errors by name, for white noise of the given `sigma`.
        covariance: covariance of the estimates in the order of `names`, shape (names, names).
        chi2: sum of the squared residuals over their variances.
        converged: whether the solver converged and chi2 is consistent with `sigma`.
        names: names of the estimates in the order of the covariance.

    Examples:
        >>> import fricjax as fj
        >>> issubclass(fj.Estimate, eqx.Module)
        True
    """

    values: dict[str, Array]
    std_errors: dict[str, Array]
    covariance: Float[Array, "names names"]
    chi2: Float[Array, ""]
    converged: Bool[Array, ""]
    names: tuple[str, ...] = eqx.field(static=True)


def estimate(
    x: ArrayLike,
    ts: ArrayLike,
    oscillator: Oscillator,
    names: Sequence[str],
    *,
    x0: ArrayLike | None = None,
    nuisance: Sequence[str] = ("x0", "offset"),
    half_cycles: ArrayLike | None = None,
    sigma: ArrayLike = 1.0,
    mask: ArrayLike | None = None,
    engine: str | AbstractEngine = "auto",
    observation: str | Observation = "displacement",
    solver: optx.AbstractLeastSquaresSolver | None = None,
) -> Estimate:
    """Estimate coefficients by least squares; a pure function.

    It supports `jax.jit`, `jax.vmap` and differentiation. The derivatives with respect to the data and to the fixed
    coefficients follow from the implicit function theorem at the optimum. Unlike :func:`fricjax.fit`, the function does
    not divide the record into half-cycles, does not analyse the noise, and prints no messages.

    Args:
        x: measured displacement [m], or another reading, shape (samples,).
        ts: times after the release [s], shape (samples,).
        oscillator: the fixed coefficients, and the start values of the free ones.
        names: free coefficients of the oscillator.
        x0: displacement at time zero [m], fixed or the start value; None uses the first sample of a displacement.
        nuisance: free parameters of the record: any of "x0", "v0" (velocity at time zero), "offset" (zero point or
            bias) and "drift" (change of the offset per second).
        half_cycles: number of half-cycles before the stop. None uses the rest condition of the law. Start values that
            are off by ten percent may otherwise lead to the optimum of another number, where `converged` is False.
        sigma: standard deviation of the noise of the reading, one number or shape (samples,).
        mask: True for the samples to use, shape (samples,).
        engine: as in :func:`fricjax.simulate`.
        observation: map from the motion to the reading: "displacement", "velocity", "acceleration", or an
            :class:`fricjax.Observation`.
        solver: least-squares solver of optimistix; None for Levenberg-Marquardt with a statistical stopping rule.

    Raises:
        UsageError: unknown or repeated names, coefficients that no record can separate, or a reading other than a
            displacement without `x0`.
        ValueError: `x` and `ts` of different shapes, or an engine that cannot integrate this oscillator.

    Examples:
        >>> import fricjax as fj
        >>> import numpy as np
        >>> machine = fj.Oscillator(0.1, 1000.0, damping=0.05, normal_force=10.0, friction=fj.friction.Coulomb(0.01))
        >>> ts = np.linspace(0.0, 0.3, 601)
        >>> records = jax.vmap(lambda x0: fj.simulate(machine, x0, ts).x)(jnp.asarray([2e-3, 3e-3]))
        >>> guess = fj.Oscillator(0.1, 1000.0, damping=0.06, normal_force=10.0, friction=fj.friction.Coulomb(0.0105))
        >>> found = jax.vmap(lambda x: fj.estimate(x, ts, guess, ["mu", "damping"], sigma=1e-9))(records)
        >>> found.values["mu"].round(6).tolist(), found.converged.tolist()
        ([0.01, 0.01], [True, True])
    """
    ready()
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    check_type("names", names, list | tuple, "a list of names")
    x, ts, sigma = (
        jnp.asarray(value if isinstance(value, jax.Array) else real(name, value, "real numbers"), float)
        for name, value in (("x", x), ("ts", ts), ("sigma", sigma))
    )
    if sigma.ndim and sigma.shape != x.shape:
        raise ValueError(f"sigma must be one number or one for each sample, got the shape {sigma.shape}.")
    if x.ndim != 1 or x.shape != ts.shape:
        raise ValueError(
            f"x and ts must have one entry for each sample, got the shapes {x.shape} and {ts.shape}. For several "
            "records use jax.vmap."
        )
    coefficients = leaves_of(oscillator)
    free, _ = chosen(names, coefficients, bracketable=False)
    for name in nuisance:
        check_choice("nuisance", name, _NUISANCES)
    labels = (*(leaf.name for leaf in free), *nuisance)
    if len(set(labels)) < len(labels):
        raise UsageError(f"A parameter is named twice in nuisance={list(nuisance)}.")

    leaves, structure = jax.tree.flatten(oscillator)
    places = tuple(leaf.index for leaf in free)
    observed = observed_as(observation, "m")
    if x0 is None and observed.kind != "displacement":
        raise UsageError(f"A {observed.kind} does not show the displacement at time zero: give x0.")
    start = x[0] if x0 is None else jnp.asarray(x0, float)
    # Under jax.jit even an element of a constant array on the device is traced.
    duration = None if isinstance(ts, Tracer) else float(np.asarray(ts)[-1])
    capacity = half_cycle_capacity(oscillator, duration, start, 0.0)
    # A coefficient on the device counts as present for the choice of the engine, even if its value is zero.
    varied = [jnp.asarray(leaf) if i in places else leaf for i, leaf in enumerate(leaves)]
    method = select_engine(engine, jax.tree.unflatten(structure, varied), max_half_cycles=capacity)
    count = None if half_cycles is None else jnp.asarray(half_cycles)

    used = jnp.ones(x.shape, bool) if mask is None else jnp.asarray(mask, bool)
    # A masked sample may hold any value, also NaN.
    x = jnp.where(used, x, 0.0)
    weights = jnp.where(used, 1 / jnp.asarray(sigma, float), 0.0)
    values, covariance, chi2, converged = _optimum(
        method,
        solver or LevenbergMarquardt(tolerance=_TOLERANCE),
        places,
        tuple(nuisance),
        structure,
        observed,
        (x, ts, [jnp.asarray(leaf, float) for leaf in leaves], start, weights, count),
        jnp.sum(used),
    )
    return Estimate(
        values=dict(zip(labels, values, strict=True)),
        std_errors=dict(zip(labels, jnp.sqrt(jnp.diag(covariance)), strict=True)),
        covariance=covariance,
        chi2=chi2,
        converged=converged,
        names=labels,
    )


@eqx.filter_jit
def _optimum(
    engine: AbstractEngine,
    solver: optx.AbstractLeastSquaresSolver,
    places: tuple[int, ...],
    nuisance: tuple[str, ...],
    structure: Any,
    observation: Observation,
    args: tuple,
    used: Int[Array, ""],
) -> tuple[Array, Array, Array, Array]:
    """Solve the least-squares problem.

    Args:
        engine: engine of the motion.
        solver: least-squares solver.
        places: indices of the free leaves of the oscillator.
        nuisance: free parameters of the record.
        structure: pytree structure of the oscillator.
        observation: map from the motion to the reading.
        args: record, times, leaves of the oscillator, displacement at time zero, weights, and number of half-cycles.
        used: number of samples with a weight.

    Returns:
        Estimates, covariance, chi2, and whether the optimum describes the record.
    """
    x, _, leaves, start, weights, _ = args
    frequency = jax.tree.unflatten(structure, leaves).angular_frequency
    starts = {name: jnp.zeros(()) for name in _NUISANCES} | {"x0": start}
    sizes = {
        "x0": jnp.abs(start),
        "v0": jnp.abs(start) * frequency,
        "offset": jnp.abs(start) * observation.gain(frequency),
    }
    sizes["drift"] = sizes["offset"] * frequency
    first = [*(leaves[i] for i in places), *(starts[name] for name in nuisance)]
    scale = [*(jnp.where(leaf == 0, 1.0, jnp.abs(leaf)) for leaf in first[: len(places)]), *map(sizes.get, nuisance)]
    # The optimum does not depend on the start of the search or on the units.
    first, scale = (jax.lax.stop_gradient(jnp.stack(each)) for each in (first, scale))

    def residual(y: Array, args: tuple) -> Array:
        x, ts, leaves, start, weights, half_cycles = args
        leaves = list(leaves)
        for i, value in zip(places, y * scale, strict=False):
            leaves[i] = value
        record = starts | {"x0": start} | dict(zip(nuisance, (y * scale)[len(places) :], strict=True))
        machine = jax.tree.unflatten(structure, leaves)
        motion = motion_of(engine, machine, record["x0"], record["v0"], None, ts, None, half_cycles)
        return (x - observe(machine, motion, observation) - record["offset"] - record["drift"] * ts) * weights

    dof = used - first.size
    unbounded = jnp.full(first.shape, jnp.inf)
    rounding = jnp.sum((jnp.finfo(float).eps * weights * x) ** 2)
    solution = optx.least_squares(
        residual,
        solver,
        first / scale,
        args,
        options={"lower": -unbounded, "upper": unbounded, "dof": dof, "floor": rounding},
        adjoint=optx.ImplicitAdjoint(),
        throw=False,
    )
    left, jacobian = residual_and_jacobian(lambda y: residual(y, args), solution.value)
    covariance = jnp.linalg.inv(jacobian.T @ jacobian) * scale * scale[:, None]
    chi2 = jnp.sum(left**2)
    describes = chi2 <= dof + SURE * jnp.sqrt(2 * dof)
    return solution.value * scale, covariance, chi2, describes & (solution.result == optx.RESULTS.successful)
