"""Names of the coefficients of an oscillator: its leaves, each by the shortest name that tells it from the others."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax

from ..friction.coefficient import Coefficient
from .names import named
from .oscillator import Oscillator


class Leaf(NamedTuple):
    """A coefficient of an oscillator: its shortest unambiguous name, its place among the leaves, and what it is."""

    name: str
    dotted: str
    index: int
    coefficient: Coefficient

    @property
    def kind(self) -> str:
        """Last part of the name."""
        return self.name.rsplit(".", 1)[-1]

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.coefficient.unit


def leaves_of(oscillator: Oscillator) -> tuple[Leaf, ...]:
    """All coefficients of an oscillator in the order of its leaves."""
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(oscillator)[0]]
    dotted = [".".join(_parts(path)) for path in paths]
    pairs = zip(named(dotted), paths, strict=True)
    return tuple(Leaf(*name, i, _coefficient(oscillator, path)) for i, (name, path) in enumerate(pairs))


def _parts(path: Sequence) -> list[str]:
    """The names along a path: laws of a sum are numbered, and so are numbers of a list, as in ``forces_3``."""
    parts: list[str] = []
    inside_sum = False
    for key in path:
        if not hasattr(key, "name"):
            parts = [*parts, str(key.idx)] if inside_sum else [*parts[:-1], f"{parts[-1]}_{key.idx}"]
        elif key.name != "laws":
            parts.append(key.name)
        inside_sum = getattr(key, "name", None) == "laws"
    return parts


def _coefficient(oscillator: Oscillator, path: Sequence) -> Coefficient:
    """What the model knows of a leaf: the owner of a list of numbers knows it by the name of the list."""
    named = max(i for i, key in enumerate(path) if hasattr(key, "name"))
    owner: Any = oscillator
    for key in path[:named]:
        owner = getattr(owner, key.name) if hasattr(key, "name") else owner[key.idx]
    return owner.coefficients[path[named].name]
