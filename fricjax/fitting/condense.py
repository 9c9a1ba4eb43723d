"""Condense samples between reversals to nodes of a Gauss quadrature.

Between reversals a motion is smooth: to far below the noise it is a polynomial p of degree below d. For n samples x_i
with weights w_i at times t_i let q be their weighted least-squares polynomial of degree below d. Then

    sum w_i (x_i - p(t_i))^2  =  sum w_i (x_i - q(t_i))^2  +  sum w_i (q - p)^2(t_i),

since x - q is orthogonal to all such polynomials. The first sum does not depend on p. The square in the second has a
degree below 2 d, so the Gauss quadrature for the samples, with d nodes s_j and weights W_j, gives it exactly:
sum W_j (q(s_j) - p(s_j))^2. So d samples q(s_j) of weight W_j have, for every such motion, the same gradient and the
same normal matrix as the n samples: the estimate and its covariance do not change (Golub and Welsch, Math. Comp. 23,
1969, for nodes and weights).

Samples near the reversals, where the acceleration jumps or a law changes fast, are kept unchanged.
"""

import functools
import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

DEGREE = 14
_WORTHWHILE = 2 * DEGREE
_LONGEST = 8192
_EVEN = 1e-9


class Rule(NamedTuple):
    """Gauss quadrature of weighted samples.

    Attributes:
        nodes: in [-1, 1].
        weights: of the nodes.
        project: matrix from samples to nodes.
    """

    nodes: np.ndarray
    weights: np.ndarray
    project: np.ndarray


class Condensation(NamedTuple):
    """Selection of few samples with the same normal equations as many.

    It depends on times and weights only, and is linear in the displacements.

    Attributes:
        used: True for samples of non-zero weight, shape (n,).
        t, weight: times and weights of the few samples, shape (m,).
        panels: index ranges of the used samples in order, and the matrix from the samples of each range to its nodes;
            None for samples that are kept unchanged.
    """

    used: np.ndarray
    t: np.ndarray
    weight: np.ndarray
    panels: Sequence[tuple[int, int, np.ndarray | None]]

    def of(self, x: np.ndarray) -> np.ndarray:
        """Return displacements of the few samples, given those of the many [m]."""
        x = x[self.used]
        parts = (x[begin:end] if project is None else project @ x[begin:end] for begin, end, project in self.panels)
        return np.concatenate(list(parts))


def condense(t: np.ndarray, weight: np.ndarray, breaks: ArrayLike, margins: ArrayLike) -> Condensation:
    """Condense the used samples between the breaks.

    Args:
        t: times of samples, in order [s].
        weight: one over the noise of each [1/m]; samples of weight zero are dropped.
        breaks: instants at which the motion is not smooth [s], in order. It must be smooth before the first and after
            the last one.
        margins: half-width of the interval around each break in which samples are kept unchanged [s].

    Returns:
        The few samples, in the order of time.
    """
    used = weight > 0
    t, weight = t[used], weight[used]
    even = _is_even(t, weight)
    times, weights, panels = [], [], []
    for begin, end, smooth in _panels(t, breaks, margins):
        place, power, project = t[begin:end], weight[begin:end], None
        if smooth:
            middle, half = (place[0] + place[-1]) / 2, (place[-1] - place[0]) / 2
            if even or _is_even(place, power):
                rule, size = _even_rule(place.size), power[0]
            else:
                rule, size = gauss_rule((place - middle) / half, power**2), 1.0
            place, power, project = middle + half * rule.nodes, size * np.sqrt(rule.weights), rule.project
        times.append(place)
        weights.append(power)
        panels.append((begin, end, project))
    return Condensation(used, np.concatenate(times), np.concatenate(weights), panels)


def _panels(t: np.ndarray, breaks: ArrayLike, margins: ArrayLike) -> Iterator[tuple[int, int, bool]]:
    """Yield index ranges of all samples, and True if to be condensed."""
    below = np.searchsorted(t, np.subtract(breaks, margins))
    above = np.searchsorted(t, np.add(breaks, margins), side="right")
    at = 0
    for begin, end in zip([*below.tolist(), t.size], [*above.tolist(), t.size], strict=True):
        if begin - at >= _WORTHWHILE:
            pieces = -(-(begin - at) // _LONGEST)
            edges = [at + (begin - at) * i // pieces for i in range(pieces + 1)]
            yield from ((low, high, True) for low, high in itertools.pairwise(edges))
            at = begin
        if end > at:
            yield at, end, False
            at = end


def _is_even(t: np.ndarray, weight: np.ndarray) -> bool:
    """Return True if all samples have equal weights and are equidistant."""
    interval = (t[-1] - t[0]) / (t.size - 1)
    apart = np.abs(t - t[0] - interval * np.arange(t.size))
    return bool(np.all(weight == weight[0]) and np.all(apart < _EVEN * interval + 4e-16 * np.abs(t[-1])))


@functools.lru_cache(maxsize=256)
def _even_rule(n: int) -> Rule:
    return gauss_rule(np.linspace(-1, 1, n), np.ones(n))


def gauss_rule(place: np.ndarray, power: np.ndarray) -> Rule:
    """Return the Gauss quadrature of the measure with weights `power` at `place`.

    It follows from the orthonormal polynomials of Stieltjes.
    """
    diagonal, off_diagonal, basis = np.zeros(DEGREE), np.zeros(DEGREE), np.zeros((DEGREE, place.size))
    total = power.sum()
    here, before = np.full(place.size, 1 / np.sqrt(total)), np.zeros(place.size)
    for k in range(DEGREE):
        basis[k] = here
        diagonal[k] = np.sum(power * place * here**2)
        rest = (place - diagonal[k]) * here - (off_diagonal[k - 1] * before if k else 0.0)
        off_diagonal[k] = np.sqrt(np.sum(power * rest**2))
        before, here = here, rest / off_diagonal[k]
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(off_diagonal[:-1], 1) + np.diag(off_diagonal[:-1], -1))
    weights = total * vectors[0] ** 2
    # Values of the orthonormal polynomials at a node are the components of its eigenvector, up to the scale.
    values = vectors / (vectors[0] * np.sqrt(total))
    return Rule(nodes, weights, values.T @ (basis * power))
