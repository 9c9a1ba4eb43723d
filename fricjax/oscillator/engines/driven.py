"""Driven motion under set-valued friction: a floor that shakes, a holding force that dies away.

Half-cycles in closed form or in phase angle need a mass that is left to itself. A driven one is integrated in time, by
steps that end at every reversal and every slip (:mod:`.stick_slip`), and with half the step again until both agree to
the accuracy asked for.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...errors import UsageError
from ...friction.base import Scalar
from ..drive import ExponentialRelease
from ..oscillator import Oscillator
from ..session import ready
from .stick_slip import Floor, Machine, State, advance, direction_from_rest

# Longest step at first, in radians of the natural frequency and in steps per time constant of the release. Both are
# only where the halving begins, which goes on until the motion no longer changes.
_PHASE_PER_STEP, _STEPS_PER_DECAY = 0.02, 4
# After so many time constants the holding force is below rounding, exp(-40) = 4e-18.
_DECAYS = 40
_HALVINGS = 8


class DrivenMotion(NamedTuple):
    """A driven motion at its sample times.

    Attributes:
        t: times [s], shape (samples,).
        x: displacement from the equilibrium of the spring [m], shape (samples,).
        v: velocity [m/s], shape (samples,).
        at_rest: True where the mass is held, by friction or before its release, shape (samples,).

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> motion = driven_motion(oscillator, 5e-5, np.linspace(0.0, 0.01, 3))
        >>> motion.at_rest.tolist()
        [True, True, True]
    """

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    at_rest: np.ndarray


def driven_motion(
    oscillator: Oscillator,
    x0: float,
    ts: np.ndarray,
    *,
    v0: float = 0.0,
    base_acceleration: np.ndarray | None = None,
    release: ExponentialRelease | None = None,
    accuracy: float = 1e-10,
) -> DrivenMotion:
    """Integrate ``m a + damping v + drag v|v| + R(x) + F = -m a_floor + F_hold(t)`` from time zero.

    Args:
        oscillator: the machine; its friction law must be set-valued.
        x0: displacement at time zero [m]; before it the mass is held there.
        ts: times to sample at, increasing [s], shape (samples,).
        v0: velocity at time zero [m/s].
        base_acceleration: floor acceleration at `ts` [m/s^2], linear between them, shape (samples,).
        release: law by which the force that balanced the spring at `x0` decays from time zero on.
        accuracy: largest error of the displacement aimed at [m].

    Raises:
        UsageError: a law that is not set-valued, or an accuracy out of reach.
        RuntimeError: JAX computes in single precision.

    Examples:
        A floor whose acceleration grows shakes a mass loose once its inertia outweighs static friction, at 1 m/s^2:

        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> times = np.linspace(0.0, 0.01, 3)
        >>> driven_motion(oscillator, 0.0, times, base_acceleration=200.0 * times).at_rest.tolist()
        [True, True, False]
    """
    ready()
    if not oscillator.friction.set_valued:
        name = type(oscillator.friction).__name__
        raise UsageError(f"{name} has no jump at rest; drive it by simulate(base_acceleration=..., release=...).")
    times = np.asarray(ts, float)
    floor = np.zeros(times.shape) if base_acceleration is None else np.asarray(base_acceleration, float)
    after = np.maximum(times, 0.0)
    knots = np.concatenate([[0.0], after])
    x, v, direction, _ = _refined(
        oscillator, (x0, v0), jnp.asarray(knots), jnp.interp(knots, times, floor), release, accuracy
    )
    before_release = times < 0
    return DrivenMotion(
        times, np.where(before_release, x0, x), np.where(before_release, 0.0, v), before_release | (direction == 0)
    )


def _refined(
    oscillator: Oscillator,
    start: tuple[float, float],
    knots: Float[Array, " knots"],
    floor: Float[Array, " knots"],
    release: ExponentialRelease | None,
    accuracy: float,
) -> State:
    """The motion at all knots but the first, with steps halved until that changes no displacement by `accuracy`."""
    x0, v0 = (jnp.asarray(value, float) for value in start)
    machine = Machine(oscillator, oscillator.restoring_force(x0), release)
    before = _integrate(machine, x0, v0, knots, floor, jnp.asarray(1.0))
    change = np.inf
    for halving in range(1, _HALVINGS + 1):
        state = _integrate(machine, x0, v0, knots, floor, jnp.asarray(2.0**halving))
        change = float(np.max(np.abs(np.asarray(state.x) - np.asarray(before.x))))
        if change <= accuracy:
            return State(*(np.asarray(part) for part in state))  # type: ignore[arg-type]
        before = state
    raise UsageError(
        f"The driven motion still changes by {change:.1e} m when its steps are halved, and {accuracy:.1e} m was asked "
        "for; use a law that changes less abruptly at low speed, or check the coefficients."
    )


@eqx.filter_jit
def _integrate(
    machine: Machine,
    x0: Scalar,
    v0: Scalar,
    knots: Float[Array, " knots"],
    floor: Float[Array, " knots"],
    divisions: Scalar,
) -> State:
    """One pass over all intervals between knots; in each as many steps as its length needs."""
    lengths = jnp.diff(knots)
    floors = Floor(knots[:-1], floor[:-1], jnp.diff(floor) / jnp.maximum(lengths, jnp.finfo(float).tiny))
    level = Floor(knots[0], floor[0], jnp.zeros(()))
    from_rest = direction_from_rest(machine, level, knots[0], x0, jnp.asarray(False))
    direction = jnp.where(v0 == 0, from_rest, jnp.sign(v0))
    start = State(x0, v0, direction, direction != 0)

    def interval(state: State, inputs: tuple[Floor, Array]) -> tuple[State, State]:
        line, length = inputs
        state = _through(machine, line, length, state, divisions)
        return state, state

    return jax.lax.scan(interval, start, (floors, lengths))[1]


def _through(machine: Machine, floor: Floor, length: Scalar, state: State, divisions: Scalar) -> State:
    """Steps of equal phase through one interval, short ones while the holding force decays."""

    def longest(t: Scalar) -> Scalar:
        swing = jnp.asarray(_PHASE_PER_STEP / machine.oscillator.angular_frequency)
        if machine.release is not None:
            decay = machine.release.time_constant
            swing = jnp.where(t < _DECAYS * decay, jnp.minimum(swing, decay / _STEPS_PER_DECAY), swing)
        return swing / divisions

    def step(carry: tuple[Scalar, State]) -> tuple[Scalar, State]:
        done, now = carry
        left = length - done
        h = left / jnp.ceil(left / longest(floor.since + done))
        return done + h, advance(machine, floor, floor.since + done, h, now)

    begin = (jnp.zeros(()), state)
    return jax.lax.while_loop(lambda carry: carry[0] < length * (1 - 1e-12), step, begin)[1]
