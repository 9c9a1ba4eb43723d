"""Energy of a motion and its losses."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..errors import check_type
from .motion import Motion
from .oscillator import Oscillator

Samples = Float[Array, " samples"]


class Energy(eqx.Module):
    """Energies [J] and loss powers [W] along a motion.

    Powers are positive if energy leaves the oscillator.

    Attributes:
        kinetic: m v^2/2.
        potential: energy of the restoring force.
        damping_power: loss to viscous damping, c v^2.
        drag_power: loss to quadratic drag, drag |v|^3.
        friction_power: loss to friction, F v.
        hysteresis_power: loss to the internal friction of the spring.

    Examples:
        >>> none = jnp.zeros(2)
        >>> kinetic, potential = jnp.asarray([0.0, 2e-3]), jnp.asarray([3e-3, 0.5e-3])
        >>> Energy(kinetic, potential, none, none, none, none).total.tolist()
        [0.003, 0.0025]
    """

    kinetic: Samples
    potential: Samples
    damping_power: Samples
    drag_power: Samples
    friction_power: Samples
    hysteresis_power: Samples

    @property
    def total(self) -> Samples:
        """Sum of kinetic and potential energy [J]."""
        return self.kinetic + self.potential

    @property
    def loss_power(self) -> Samples:
        """Sum of all losses [W], minus the rate of the total energy."""
        return self.damping_power + self.drag_power + self.friction_power + self.hysteresis_power


def energy(oscillator: Oscillator, motion: Motion) -> Energy:
    """Compute energies and loss powers along a motion.

    Args:
        oscillator: the oscillator that was simulated.
        motion: the result of :func:`fricjax.simulate`.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> motion = fj.simulate(oscillator, 2e-3, jnp.asarray([0.0, 1.0]))
        >>> print(f"released with {float(fj.energy(oscillator, motion).total[0]):.1e} J")
        released with 2.0e-03 J
    """
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    check_type("motion", motion, Motion, "the Motion of fricjax.simulate")
    v = motion.v
    return Energy(
        kinetic=oscillator.mass * v**2 / 2,
        potential=oscillator.restoring.potential(motion.x, oscillator.stiffness),
        damping_power=oscillator.damping * v**2,
        drag_power=oscillator.drag * jnp.abs(v) * v**2,
        friction_power=motion.friction_force * v,
        hysteresis_power=oscillator.hysteresis(motion.x) * jnp.abs(v),
    )
