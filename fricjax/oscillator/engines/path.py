"""A computed motion before it is sampled: what an engine hands to whoever wants displacements at given times."""

import abc

import equinox as eqx
from equinox import AbstractVar
from jaxtyping import Array, Float


class AbstractPath(eqx.Module):
    """A motion that can be read off at any time; a pytree, so that its tangents can be carried along.

    Attributes:
        turning_points: displacements of a start at rest and of each reversal [m], NaN behind the last; empty where they
            are not noted.
    """

    turning_points: AbstractVar[Float[Array, " turning_points"]]

    @abc.abstractmethod
    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        """Displacement [m] and velocity [m/s] at `ts` [s] after the start."""
