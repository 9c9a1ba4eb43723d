"""Parameter space of a fit: names, transforms, scales and bounds.

Every coordinate is zero at the start value. Positive quantities that may span decades (mass, stiffness, widths) are
fitted as logarithms. The stiffness of a contact is fitted as its inverse square root, in which the motion is nearly
linear. All others are linear in units of a typical size.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from .arrays import namespace

# Nuisance parameters that enter the reading linearly, so that they can be projected out.
LINEAR = frozenset({"offset", "drift"})


class Parameter(NamedTuple):
    """Free parameter with start value, typical size and bounds, in its unit.

    `fitted_as` is "value", "logarithm" or "inverse root". From the value `rigid` on, a record cannot distinguish a
    contact from a rigid one.
    """

    name: str
    unit: str
    start: float
    scale: float
    lower: float = -np.inf
    upper: float = np.inf
    fitted_as: str = "value"
    rigid: float = np.inf

    @property
    def kind(self) -> str:
        """Last part of the name, without the number of a run."""
        return self.name.rsplit(".", 1)[-1].split("[", 1)[0]


class Tie(NamedTuple):
    """Leaf tied to a free parameter: leaf = factor * parameter."""

    leaf: int
    parameter: int
    factor: float


@functools.partial(
    jax.tree_util.register_dataclass,
    data_fields=("start", "scale"),
    meta_fields=("fitted_as", "leaves", "ties", "nuisances"),
)
# Not an equinox module: a fit calls its methods often, and those of a module are made at each access.
@dataclasses.dataclass(frozen=True)
class ParameterSpace:
    """Map from coordinates to parameter values and into a model.

    Attributes:
        start, scale: start values and typical sizes, shape (p,).
        fitted_as: for each parameter "value", "logarithm" or "inverse root".
        leaves: for each shared parameter the index of its leaf in the model.
        ties: leaves that follow a parameter.
        nuisances: for each run the names of its nuisance parameters, in order after the shared ones.
    """

    start: Float[Array | np.ndarray, " p"]
    scale: Float[Array | np.ndarray, " p"]
    fitted_as: tuple[str, ...]
    leaves: tuple[int, ...]
    ties: tuple[Tie, ...]
    nuisances: tuple[tuple[str, ...], ...]

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
            fitted_as=tuple(p.fitted_as for p in parameters),
            leaves=tuple(leaves),
            ties=tuple(ties),
            nuisances=tuple(tuple(names) for names in nuisances),
        )

    def values(self, q: Float[Array | np.ndarray, " p"]) -> Float[Array, " p"]:
        """Return the values of all parameters at coordinates `q`."""
        xp, log, inverse = namespace(q), self._fitted("logarithm"), self._fitted("inverse root")
        # Both branches of `where` are differentiated, so each must be finite for all coordinates.
        powers = self.start * xp.exp(xp.where(log, q, 0.0))
        quotients = self.start / xp.where(inverse, 1 - q, 1.0) ** 2
        return xp.where(log, powers, xp.where(inverse, quotients, self.start + self.scale * q))

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Return the coordinates of values; -inf for a transformed value of zero."""
        log, inverse = self._fitted("logarithm"), self._fitted("inverse root")
        positive = np.maximum(np.where(log | inverse, values, 1.0), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = positive / np.where(log | inverse, self.start, 1.0)
            curved = np.where(log, np.log(ratio), 1 - 1 / np.sqrt(ratio))
        return np.where(log | inverse, curved, (values - self.start) / self.scale)

    def slope(self, q: Float[Array | np.ndarray, " p"]) -> Float[Array, " p"]:
        """Return the derivative of each value with respect to its coordinate."""
        log, inverse, values = self._fitted("logarithm"), self._fitted("inverse root"), self.values(q)
        xp = namespace(q)
        ratio = xp.where(inverse, values, 1.0) / xp.where(inverse, self.start, 1.0)
        return xp.where(log, values, xp.where(inverse, 2 * values * xp.sqrt(ratio), self.scale))

    def _fitted(self, way: str) -> np.ndarray:
        return np.array([fitted == way for fitted in self.fitted_as])

    def model[Model](self, template: Model, values: Float[Array, " p"]) -> Model:
        """Return the model with the shared parameters set to their values."""
        leaves, structure = jax.tree.flatten(template)
        for position, leaf in enumerate(self.leaves):
            leaves[leaf] = values[position]
        for tie in self.ties:
            leaves[tie.leaf] = tie.factor * values[tie.parameter]
        return jax.tree.unflatten(structure, leaves)

    @property
    def alike(self) -> bool:
        """True if all runs have the same nuisance parameters."""
        return len(set(self.nuisances)) == 1

    def places(self, run: Any) -> dict[str, Any]:
        """Return the indices of one run's nuisance parameters by name.

        `run` may be traced if all runs are alike.
        """
        before = run * len(self.nuisances[0]) if self.alike else sum(map(len, self.nuisances[:run]))
        names = self.nuisances[0 if self.alike else run]
        return {name: len(self.leaves) + before + i for i, name in enumerate(names)}

    def run_values(self, values: Float[Array | np.ndarray, " p"], run: Any) -> dict[str, Any]:
        """Return the nuisance parameters of one run by name."""
        return {name: values[place] for name, place in self.places(run).items()}
