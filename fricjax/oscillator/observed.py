"""The reading of an instrument that watches a motion."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..data.observation import Observation
from ..errors import check_type
from .motion import Motion
from .oscillator import Oscillator


def observe(
    oscillator: Oscillator,
    motion: Motion,
    observation: Observation,
    *,
    base_acceleration: ArrayLike | None = None,
) -> Float[Array, " samples"]:
    """Compute the reading of a motion, without noise, offset and drift.

    The acceleration is that of the equation of motion, ``-(damping v + drag v|v| + R(x) + F_f)/m``, and zero at rest.
    At a reversal it jumps.

    Args:
        oscillator: the oscillator that was simulated.
        motion: the result of :func:`fricjax.simulate`.
        observation: the map from the motion to the reading.
        base_acceleration: floor acceleration at the samples [m/s^2], shape (samples,), if the motion has one. The
            acceleration is then that relative to the floor.

    Returns:
        The reading in the unit of the observation, shape (samples,).

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.01))
        >>> motion = fj.simulate(machine, 2e-3, jnp.asarray([0.005, 0.01]))
        >>> velocity = fj.observe(machine, motion, fj.Observation("velocity"))
        >>> bool(jnp.all(velocity == motion.v))
        True
    """
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    check_type("motion", motion, Motion, "the Motion of fricjax.simulate")
    check_type("observation", observation, Observation, "an Observation")
    if observation.order < 2:
        return observation.read((motion.x, motion.v)[observation.order], jnp)
    x, v = jnp.asarray(motion.x), jnp.asarray(motion.v)
    spring = oscillator.restoring_force(x) + oscillator.hysteresis(x) * jnp.sign(v)
    acceleration = -(oscillator.dissipation(v) + spring + motion.friction_force) / oscillator.mass
    if base_acceleration is not None:
        acceleration = acceleration - jnp.asarray(base_acceleration)
    return observation.read(jnp.where(motion.at_rest, 0.0, acceleration), jnp)
