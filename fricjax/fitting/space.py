"""The space in which a fit works, kept apart from the physics: names, transforms, scales and bounds.

Every coordinate is zero at the start value. Quantities that must be positive and may range over decades (mass,
stiffness, widths) are fitted in their logarithm, all others linearly in units of a typical size.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..oscillator import Oscillator

LINEAR = frozenset({"offset", "drift"})


class Parameter(NamedTuple):
    """One free parameter: where it starts, its typical size, and its bounds, all in its own unit.

    `logarithmic` says whether the fit works in its logarithm.
    """

    name: str
    unit: str
    start: float
    scale: float
    lower: float = -np.inf
    upper: float = np.inf
    logarithmic: bool = False

    @property
    def kind(self) -> str:
        """Last part of the name, without the number of a run."""
        return self.name.rsplit(".", 1)[-1].split("[", 1)[0]


class Tie(NamedTuple):
    """A leaf that follows a free parameter: leaf = factor * parameter."""

    leaf: int
    parameter: int
    factor: float


class ParameterSpace(eqx.Module):
    """Carries coordinates to values and values into an oscillator.

    Attributes:
        start, scale: start values and typical sizes, shape (p,).
        logarithmic: which parameters are fitted in their logarithm.
        leaves: for each shared parameter the index of its leaf in the oscillator.
        ties: leaves that follow a parameter.
        nuisances: for each run the names of its own parameters, in order after the shared ones.
    """

    start: Float[Array | np.ndarray, " p"]
    scale: Float[Array | np.ndarray, " p"]
    logarithmic: tuple[bool, ...] = eqx.field(static=True)
    leaves: tuple[int, ...] = eqx.field(static=True)
    ties: tuple[Tie, ...] = eqx.field(static=True)
    nuisances: tuple[tuple[str, ...], ...] = eqx.field(static=True)

    @classmethod
    def build(
        cls,
        parameters: Sequence[Parameter],
        leaves: Sequence[int],
        ties: Sequence[Tie],
        nuisances: Sequence[Sequence[str]],
    ) -> "ParameterSpace":
        return cls(
            start=np.array([p.start for p in parameters]),
            scale=np.array([p.scale for p in parameters]),
            logarithmic=tuple(p.logarithmic for p in parameters),
            leaves=tuple(leaves),
            ties=tuple(ties),
            nuisances=tuple(tuple(names) for names in nuisances),
        )

    def values(self, q: Float[Array, " p"]) -> Float[Array, " p"]:
        """Values of all parameters at coordinates `q`."""
        log = jnp.asarray(self.logarithmic)
        return jnp.where(log, self.start * jnp.exp(jnp.where(log, q, 0.0)), self.start + self.scale * q)

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Coordinates of given values; minus infinity for a zero that is fitted in its logarithm."""
        log = np.asarray(self.logarithmic)
        ratio = np.where(log, values / np.where(log, self.start, 1.0), 1.0)
        with np.errstate(divide="ignore"):
            return np.where(log, np.log(np.maximum(ratio, 0.0)), (values - self.start) / self.scale)

    def slope(self, q: Float[Array, " p"]) -> Float[Array, " p"]:
        """Derivative of each value with respect to its coordinate."""
        return jnp.where(jnp.asarray(self.logarithmic), self.values(q), self.scale)

    def oscillator(self, template: Oscillator, values: Float[Array, " p"]) -> Oscillator:
        """The oscillator with the shared parameters at their values."""
        leaves, structure = jax.tree.flatten(template)
        for position, leaf in enumerate(self.leaves):
            leaves[leaf] = values[position]
        for tie in self.ties:
            leaves[tie.leaf] = tie.factor * values[tie.parameter]
        return jax.tree.unflatten(structure, leaves)

    def run_values(self, values: Float[Array | np.ndarray, " p"], run: int) -> dict[str, Array]:
        """The own parameters of one run by name."""
        first = len(self.leaves) + sum(len(names) for names in self.nuisances[:run])
        return {name: values[first + i] for i, name in enumerate(self.nuisances[run])}
