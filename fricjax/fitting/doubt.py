"""What it adds to the errors that a record leaves its number of half-cycles open.

Each number has an optimum of its own, which describes the record by odds of ``exp(-chi^2/2)`` to those of the others,
none being more likely beforehand. Given as one value with a standard error, what is known is the moments of that
mixture about the best of them (Gelman et al., Bayesian Data Analysis, 2013, 7.6).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Other(NamedTuple):
    """Another number of half-cycles of each run, and how probable it is."""

    half_cycles: tuple[int, ...]
    probability: float


class Doubt(NamedTuple):
    """What the other numbers of half-cycles add to the covariance of the coordinates, shape (p, p)."""

    others: tuple[Other, ...]
    covariance: np.ndarray


class End(NamedTuple):
    """The optimum of a number of half-cycles: its sum of squares of unit variance, and its coordinates, shape (p,)."""

    half_cycles: tuple[int, ...]
    misfit: float
    y: np.ndarray


def doubt_of(best: End, rivals: Sequence[End]) -> Doubt:
    """The doubt that other numbers of half-cycles leave in the one that was taken."""
    if not rivals:
        return Doubt((), np.zeros((best.y.size, best.y.size)))
    misfits = np.array([best.misfit, *(rival.misfit for rival in rivals)])
    odds = np.exp(-(misfits - misfits.min()) / 2)
    probabilities = odds[1:] / odds.sum()
    moves = np.array([rival.y - best.y for rival in rivals])
    others = [Other(rival.half_cycles, float(p)) for rival, p in zip(rivals, probabilities, strict=True)]
    return Doubt(tuple(others), (moves.T * probabilities) @ moves)
