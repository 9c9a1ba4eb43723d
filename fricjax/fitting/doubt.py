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


def doubt_of(ends: Sequence[End], parameters: int) -> Doubt:
    """The doubt in the first of several numbers of half-cycles, which is that taken; none where there are no others."""
    if not ends:
        return Doubt((), np.zeros((parameters, parameters)))
    misfits = np.array([end.misfit for end in ends])
    odds = np.exp(-(misfits - misfits.min()) / 2)
    probabilities = odds / odds.sum()
    moves = np.array([end.y - ends[0].y for end in ends])
    others = [Other(end.half_cycles, float(p)) for end, p in zip(ends[1:], probabilities[1:], strict=True)]
    return Doubt(tuple(others), (moves.T * probabilities) @ moves)
