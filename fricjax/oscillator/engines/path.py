"""A computed motion before it is sampled: what an engine hands to whoever wants displacements at given times."""

import abc

import equinox as eqx
from jaxtyping import Array, Float


class AbstractPath(eqx.Module):
    """A motion that can be read off at any time; a pytree, so that its tangents can be carried along."""

    @abc.abstractmethod
    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        """Displacement [m] and velocity [m/s] at `ts` [s] after the start."""
