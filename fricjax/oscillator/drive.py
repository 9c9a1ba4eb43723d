"""What moves a mass besides its own spring: a floor that shakes, and the force that held it, as it dies away."""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..friction.base import Scalar, scalar


class AbstractRelease(eqx.Module):
    """A holding force that decays from the moment of release.

    Examples:
        >>> issubclass(ExponentialRelease, AbstractRelease)
        True
    """

    @abc.abstractmethod
    def force(self, t: Scalar, hold: Scalar) -> Scalar:
        """Remaining force [N] a time `t` [s] after release, where `hold` [N] balanced the spring before it."""


class ExponentialRelease(AbstractRelease):
    """An electromagnet whose force dies away as ``exp(-t/time_constant)``.

    Attributes:
        time_constant: decay time of the force [s]; 0.5 to 3 ms for a small holding magnet.

    Examples:
        >>> release = ExponentialRelease(time_constant=2e-3)
        >>> print(f"{release.force(jnp.asarray(2e-3), hold=jnp.asarray(10.0)):.3f} N are left")
        3.679 N are left
    """

    time_constant: Scalar = eqx.field(converter=scalar)

    def force(self, t: Scalar, hold: Scalar) -> Scalar:
        return hold * jnp.exp(-t / self.time_constant)


class Drive(eqx.Module):
    """What moves the mass besides its own spring.

    Attributes:
        t: times at which the acceleration of the floor is known [s], shape (instants,).
        base_acceleration: that acceleration [m/s^2]; linear between them, None for a floor that stands.
        release: law by which the force that held the mass decays.
    """

    t: Float[Array | np.ndarray, " instants"]
    base_acceleration: Float[Array, " instants"] | None = None
    release: AbstractRelease | None = None
