"""Names of the coefficients of an oscillator: its leaves, each by the shortest name that tells it from the others."""

from collections.abc import Sequence
from typing import NamedTuple

import jax

from .oscillator import Oscillator


class Leaf(NamedTuple):
    """A coefficient of an oscillator: its shortest unambiguous name, its place among the leaves, and its unit."""

    name: str
    dotted: str
    index: int
    unit: str


def leaves_of(oscillator: Oscillator) -> tuple[Leaf, ...]:
    """All coefficients of an oscillator in the order of its leaves."""
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(oscillator)[0]]
    keys = [[str(getattr(key, "name", getattr(key, "idx", key))) for key in path] for path in paths]
    dotted = [".".join(part for part in parts if part != "laws") for parts in keys]
    last = [name.rsplit(".", 1)[-1] for name in dotted]
    names = [short if last.count(short) == 1 else full for short, full in zip(last, dotted, strict=True)]
    units = [_unit(oscillator, path) for path in paths]
    return tuple(Leaf(*entry) for entry in zip(names, dotted, range(len(paths)), units, strict=True))


def _unit(oscillator: Oscillator, path: Sequence) -> str:
    owner: object = oscillator
    for key in path[:-1]:
        owner = getattr(owner, key.name) if hasattr(key, "name") else owner[key.idx]  # type: ignore[index]
    return getattr(owner, "units", {}).get(path[-1].name, "")
