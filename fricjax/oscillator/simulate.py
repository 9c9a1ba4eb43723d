"""Simulation of a motion from its start."""

import dataclasses
import functools
import math
import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from ..errors import check_type
from ..numbers import real, scalar
from ..show.working import working
from .engines.base import AbstractEngine
from .motion import Motion, Start
from .oscillator import AbstractRelease, Drive, Oscillator
from .program import Program
from .select import concrete, half_cycle_capacity, select_engine
from .session import ready
from .transposable import Outputs, transposable

# Up to this many samples all motions share a compiled program. Beyond, sizes per factor of two: one if driven, else
# four.
_LEAST, _SIZES = 2048, 4


@working("Simulating")
def simulate(
    oscillator: Oscillator,
    x0: ArrayLike,
    ts: ArrayLike,
    *,
    v0: ArrayLike = 0.0,
    state0: ArrayLike | None = None,
    engine: str | AbstractEngine = "auto",
    accuracy: float = 1e-10,
    base_acceleration: ArrayLike | None = None,
    release: AbstractRelease | None = None,
    error: bool = False,
) -> Motion:
    """Simulate an oscillator that starts at `x0` at time zero.

    All numeric arguments and all coefficients of the oscillator support `jax.vmap` and derivatives of any order in
    forward and reverse mode.

    Args:
        oscillator: the oscillator with its friction law.
        x0: displacement from the equilibrium at time zero [m].
        ts: increasing sample times [s], shape (samples,). Before time zero a free motion is extrapolated backwards, and
            a driven mass is held.
        v0: velocity at time zero [m/s]. The motion has a kink as a function of `v0` at zero, the start from rest.
        state0: internal states of the law at time zero, shape (states,). None uses the states after a slow pull to
            `x0`, or after long sliding if `v0` is not zero.
        engine: "auto", "exact", "hybrid", "smooth", an engine, or "diffrax": the unmodified diffrax solvers, the
            reference for testing the other engines.
        accuracy: target for the largest numerical error of the displacement [m].
        base_acceleration: floor acceleration at `ts` [m/s^2], interpolated linearly, shape (samples,).
        release: decay law of the holding force.
        error: estimate the numerical error of the displacement from a second, finer integration. A warning states the
            error if it exceeds `accuracy`; under transformations of JAX only the field `error` of the motion states it.

    Returns:
        The motion; its `result` states whether the integration succeeded.

    Raises:
        RuntimeError: JAX computes in single precision.
        ValueError: times of the wrong shape or not increasing, or an engine that cannot integrate this oscillator.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> motion = fj.simulate(oscillator, 2e-3, np.linspace(0.0, 0.5, 501))
        >>> print(f"{motion.engine}: {int(motion.n_half_cycles)} half-cycles, rest at {float(motion.t_stop):.4f} s")
        exact: 10 half-cycles, rest at 0.3142 s
    """
    ready()
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    if not isinstance(accuracy, Tracer) and not scalar("accuracy", accuracy) > 0:
        raise ValueError(f"accuracy must be a positive length in m, got {accuracy}.")
    times = _times(ts)
    driven = base_acceleration is not None or release is not None
    duration = None if isinstance(times, Tracer) else float(np.asarray(times)[-1])
    x, v = _number("x0", x0), _number("v0", v0)
    capacity = half_cycle_capacity(oscillator, duration, x, v)
    # The phase and the shape of half-cycles are unknown in advance for a driven mass.
    driven_by = "diffrax" if oscillator.friction.set_valued else "smooth"
    name = driven_by if driven and engine == "auto" else engine
    if base_acceleration is not None:
        # The floor may reverse the mass more often than the spring does, but hardly between two samples.
        capacity = max(capacity, 2 ** math.ceil(math.log2(times.size)))
    chosen = select_engine(name, oscillator, accuracy=accuracy, max_half_cycles=capacity)
    if driven and not chosen.takes_drive:
        raise ValueError(
            "Floor motion and a decaying holding force need integration in time: leave the engine to auto, or choose "
            '"smooth" or "diffrax".'
        )
    state = None if state0 is None else _floats(state0, "state0")
    limit = _limit_engine(oscillator, capacity)
    finer = chosen.finer() if error else None
    if driven:
        padded, drive = _padded(times, base_acceleration, release)
    elif _is_traced((oscillator, x, v, state, times)):
        # Under an outer transformation the caller compiles for the given times, so padding is useless.
        return _solve(chosen, limit, finer, oscillator, x, v, state, times, None)
    else:
        padded, drive = _pad(times, _padding(times, _SIZES)), None
    args = (chosen, limit, finer, oscillator, x, v, state, padded, drive)
    motion = _solve(*args) if _is_traced(args) else Motion(engine=chosen.name, **_kept(*jax.tree.map(np.asarray, args)))
    size = None if motion.error is None else concrete(motion.error)
    if isinstance(engine, str) and size is not None and size > accuracy:
        warnings.warn(
            f"The displacement may be off by {size:.1e} m, more than accuracy={accuracy:.1e} m. Request a smaller "
            "value, or another engine.",
            stacklevel=3,
        )
    if padded.size == times.size:
        return motion
    samples = {name: getattr(motion, name) for name in ("t", "x", "v", "friction_force", "at_rest")}
    return dataclasses.replace(motion, **_first(samples, times.size))


def _is_traced(values: Any) -> bool:
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(values))


# One compiled call for all fields, since each call costs 0.2 ms.
@functools.partial(jax.jit, static_argnums=1)
def _first(samples: dict[str, Array], count: int) -> dict[str, Array]:
    return {name: values[:count] for name, values in samples.items()}


def _padding(times: Any, sizes: int = 1) -> int:
    """Return the number of padding samples up to the next compiled size.

    There are `sizes` sizes per factor of two.
    """
    unit = 2 ** (math.ceil(math.log2(times.size)) - 1) // sizes if times.size > _LEAST else _LEAST
    return -times.size % unit


def _padded(times: Any, base_acceleration: ArrayLike | None, release: AbstractRelease | None) -> tuple[Any, Drive]:
    """Pad the times of a driven motion and build its drive.

    The sample times repeat the last one. The knots of the floor acceleration continue at equal intervals instead, since
    interpolation requires distinct times.
    """
    more = _padding(times)
    padded = _pad(times, more)
    if base_acceleration is None:
        return padded, Drive(padded, None, release)
    interval = times[-1] - times[-2] if times.size > 1 else 1.0
    xp = jnp if isinstance(times, Tracer) else np
    knots = xp.concatenate([times, times[-1] + interval * xp.arange(1, more + 1)])
    return padded, Drive(knots, _pad(_floats(base_acceleration, "base_acceleration"), more), release)


def _pad(values: Any, more: int) -> Any:
    """Pad values by repeats of the last one."""
    xp = jnp if isinstance(values, jax.Array) else np
    return xp.concatenate([values, xp.repeat(values[-1:], more)])


def _limit_engine(oscillator: Oscillator, capacity: int) -> AbstractEngine | None:
    """Return the engine for a regularised law's set-valued limit, else None."""
    limit = None if oscillator.friction.set_valued else oscillator.friction.set_valued_limit()
    if limit is None or not limit.set_valued:
        return None
    return select_engine("auto", dataclasses.replace(oscillator, friction=limit), max_half_cycles=capacity)


def _floats(value: ArrayLike, name: str) -> Array | np.ndarray:
    """Convert to double precision; keep host values on the host.

    A compiled call accepts host arrays at less cost.
    """
    return jnp.asarray(value, float) if isinstance(value, jax.Array) else real(name, value, "real numbers")


def _number(name: str, value: ArrayLike) -> Any:
    number = _floats(value, name)
    if number.ndim:
        raise ValueError(f"{name} must be one number, got shape {number.shape}. For several starts use jax.vmap.")
    return number


def starting_state(oscillator: Oscillator, x0: ArrayLike, v0: ArrayLike, state0: ArrayLike | None = None) -> Start:
    """Return the start of a motion with default internal states.

    The default states are those after a slow pull to `x0`, or after long sliding if `v0` is not zero.

    Args:
        oscillator: the oscillator; its law determines the number of internal states.
        x0: displacement at time zero [m].
        v0: velocity at time zero [m/s].
        state0: internal states, shape (states,); None for the default.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> start = fj.oscillator.starting_state(oscillator, 2e-3, 0.0)
        >>> float(start.x0), start.state.shape
        (0.002, (0,))
    """
    x, v = jnp.asarray(_number("x0", x0)), jnp.asarray(_number("v0", v0))
    if state0 is None:
        law, load = oscillator.friction, oscillator.normal_force
        speed = jnp.where(v == 0, 1.0, jnp.abs(v))
        pulled = law.pulled_state(jnp.where(x < 0, -1.0, 1.0), load)
        state = jnp.where(v == 0, pulled, law.steady_state(speed, jnp.sign(v), load))
    else:
        state = jnp.reshape(jnp.asarray(state0, float), (oscillator.friction.n_states,))
    return Start(x, v, state)


def _times(ts: ArrayLike) -> Any:
    times = _floats(ts, "ts")
    if times.ndim != 1 or times.shape[0] == 0:
        raise ValueError(f"ts must be a list of at least one time [s], got an array of shape {times.shape}.")
    if isinstance(times, Tracer):
        return times
    # On the host, since an operation on a constant under an outer transformation gives a tracer.
    known = np.asarray(times)
    if not np.all(known[1:] > known[:-1]):
        raise ValueError("ts must increase from sample to sample.")
    return known


def _solved(
    engine: AbstractEngine,
    limit: AbstractEngine | None,
    finer: AbstractEngine | None,
    oscillator: Oscillator,
    x0: Array,
    v0: Array,
    state0: Array | None,
    ts: Float[Array, " samples"],
    drive: Drive | None,
) -> Motion:
    motion = motion_of(engine, oscillator, x0, v0, state0, ts, drive)
    # The distances to other motions are diagnostics. Their derivatives are zero, so those motions compile without any.
    fixed, at, v, state, times, force = jax.lax.stop_gradient((oscillator, x0, v0, state0, ts, drive))
    x = jax.lax.stop_gradient(motion.x)
    if finer is not None:
        rounding = jnp.finfo(float).eps * (1 + fixed.angular_frequency * jnp.abs(times[-1]))
        distance = jnp.abs(motion_of(finer, fixed, at, v, state, times, force).x - x)
        motion = dataclasses.replace(motion, error=jnp.max(distance) + rounding * jnp.max(jnp.abs(x)))
    if limit is None:
        return motion
    bias = jnp.asarray(jnp.nan)
    if drive is None:
        # The bias is the distance to the motion without regularisation, so that motion is computed too.
        reference = dataclasses.replace(fixed, friction=fixed.friction.set_valued_limit())
        bias = jnp.max(jnp.abs(motion_of(limit, reference, at, v, None, times).x - x))
    return eqx.tree_at(lambda m: m.regularisation_bias, motion, bias)


def motion_of(
    engine: AbstractEngine,
    oscillator: Oscillator,
    x0: Array,
    v0: Array,
    state0: Array | None,
    ts: Float[Array, " samples"],
    drive: Drive | None = None,
    half_cycles: Array | None = None,
) -> Motion:
    """Integrate with a derivative rule for both modes.

    The arguments are those of :func:`simulate` after its checks, with `half_cycles` as in the method `solve` of the
    engine.
    """

    def outputs(numbers: tuple, ts: Array) -> Outputs:
        engine, oscillator, x0, v0, state0, drive, half_cycles = numbers
        start = starting_state(oscillator, x0, v0, state0)
        driven = {} if drive is None else {"drive": drive}
        motion = engine.solve(oscillator, start, ts, half_cycles, **driven)
        return Outputs(
            (motion.x, motion.v, motion.friction_force),
            (motion.t_stop, motion.turning_points, motion.regularisation_bias),
            (motion.at_rest, motion.n_half_cycles, motion.result, motion.stats),
        )

    numbers = engine, oscillator, x0, v0, state0, drive, half_cycles
    (x, v, force), (t_stop, turning_points, bias), discrete = transposable(outputs)(numbers, ts)
    at_rest, n_half_cycles, result, stats = discrete
    return Motion(ts, x, v, force, at_rest, t_stop, turning_points, n_half_cycles, bias, engine.name, result, stats)


_solve = jax.jit(_solved)


def _fields(engine: AbstractEngine, *args: Any) -> dict[str, Any]:
    """Return the fields of a motion except the engine's name, for caching."""
    motion = _solved(engine, *args)
    return {name: getattr(motion, name) for name in _NAMES}


def _like(engine: AbstractEngine, limit: Any, finer: Any, *_: Any) -> dict[str, Any]:
    from .outcome import RESULTS

    error = None if finer is None else 0
    known = {"result": RESULTS.successful, "stats": dict.fromkeys(engine.counted, 0), "error": error}
    return dict.fromkeys(_NAMES, 0) | known


_NAMES = [each.name for each in dataclasses.fields(Motion) if each.name != "engine"]
# A single motion runs on the host; a GPU would synchronise at each of its steps.
_kept = Program(_fields, _like, kernels=False)


def final_displacement(oscillator: Oscillator, x0: ArrayLike, *, engine: str | AbstractEngine = "auto") -> Array:
    """Compute the displacement at rest after a release from `x0` [m].

    Vmapped over `x0` it gives the triangle wave of final against initial displacement.

    Args:
        oscillator: the oscillator; its friction law must be able to hold the mass.
        x0: displacement from the equilibrium at release [m].
        engine: as in :func:`simulate`.

    Returns:
        The final displacement [m]. NaN if the mass does not come to rest within the capacity for half-cycles, or, for a
        law with internal states, within ten thousand half-periods or the maximum steps of the engine. Under such a law
        it is the position at which the contact holds the mass once its remaining vibration is far below the accuracy
        of the engine.

    Raises:
        RuntimeError: JAX computes in single precision.
        ValueError: a regularised law, under which the mass never rests.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> print(f"{float(fj.final_displacement(oscillator, 2e-3)):.3e} m")
        -7.456e-05 m
    """
    ready()
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    x0 = _number("x0", x0)
    law = oscillator.friction
    if law.kind == "smooth":
        raise ValueError(
            f"Under {type(law).__name__} the mass creeps and never rests, so it has no final displacement. Use a law "
            "that holds the mass, such as Coulomb."
        )
    chosen = select_engine(engine, oscillator, max_half_cycles=half_cycle_capacity(oscillator, math.inf, x0, 0.0))
    return _final(chosen, oscillator, x0)


@jax.jit
def _final(engine: AbstractEngine, oscillator: Oscillator, x0: Array) -> Array:
    def outputs(numbers: tuple, ts: Array) -> Outputs:
        engine, oscillator, x0 = numbers
        start = starting_state(oscillator, x0, 0.0)
        if not oscillator.friction.set_valued:
            return Outputs((), (engine.rest(oscillator, start),))
        motion = engine.solve(oscillator, start, jnp.asarray([1e30]))
        return Outputs((), (jnp.where(jnp.isfinite(motion.t_stop), motion.x[0], jnp.nan),))

    return transposable(outputs)((engine, oscillator, x0), jnp.zeros(0)).single[0]
