"""A computed motion before it is sampled: what an engine hands to whoever wants displacements at given times."""

import abc

import equinox as eqx
from jaxtyping import Array, Float


class AbstractPath(eqx.Module):
    """A motion that can be read off at any time; a pytree, so that its tangents can be carried along."""

    @property
    @abc.abstractmethod
    def turning_points(self) -> Float[Array, " turning_points"]:
        """Displacements of a start at rest and of each reversal [m], NaN behind the last; empty if none are noted."""

    @abc.abstractmethod
    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        """Displacement [m] and velocity [m/s] at `ts` [s] after the start."""
