"""Fewer samples that say the same: each stretch between two reversals by the nodes of a Gauss quadrature.

Between reversals a motion is smooth, and to far below the noise a polynomial p of degree below d. For n samples x_i
with weights w_i at times t_i let q be their weighted least-squares polynomial of degree below d. Then

    sum w_i (x_i - p(t_i))^2  =  sum w_i (x_i - q(t_i))^2  +  sum w_i (q - p)^2(t_i),

since x - q is orthogonal to all such polynomials. The first sum does not depend on p. The square in the second has
a degree below 2 d, so the Gauss quadrature that belongs to the samples, with d nodes s_j and weights W_j, gives it
exactly: sum W_j (q(s_j) - p(s_j))^2. So d samples q(s_j) of weight W_j have, for every such motion, the same gradient
and the same normal matrix as the n samples: the estimate and its covariance do not change (Golub and Welsch, Math.
Comp. 23, 1969, for nodes and weights).

Samples near the reversals, where the acceleration jumps or a law changes fast, are kept as they are.
"""

import functools
import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

DEGREE = 14
_WORTHWHILE = 2 * DEGREE
_LONGEST = 8192
_EVEN = 1e-9


class Samples(NamedTuple):
    """Times [s], displacements [m] and weights (one over the noise, [1/m]), each of shape (n,)."""

    t: np.ndarray
    x: np.ndarray
    weight: np.ndarray


class Rule(NamedTuple):
    """Gauss quadrature of weighted samples: nodes in [-1, 1], weights, and the matrix from samples to nodes."""

    nodes: np.ndarray
    weights: np.ndarray
    project: np.ndarray


def condense(samples: Samples, breaks: ArrayLike, margins: ArrayLike) -> Samples:
    """Condense the used samples between the breaks.

    Args:
        samples: samples in the order of time; those of weight zero are left out.
        breaks: instants at which the motion is not smooth [s], in order; what lies before the first one and behind the
            last one is taken for smooth as well.
        margins: for each break the time around it in which samples are kept as they are [s].

    Returns:
        Samples in the order of time.
    """
    used = samples.weight > 0
    samples = samples if used.all() else Samples(*(values[used] for values in samples))
    even = _is_even(samples)
    parts = [_panel(samples, panel, even) for panel in _panels(samples.t, breaks, margins)]
    return Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _panels(t: np.ndarray, breaks: ArrayLike, margins: ArrayLike) -> Iterator[tuple[int, int, bool]]:
    """Index ranges of all samples in order, and whether each is to be condensed."""
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


def _panel(samples: Samples, panel: tuple[int, int, bool], even: bool) -> Samples:
    begin, end, smooth = panel
    t, x, weight = (values[begin:end] for values in samples)
    if not smooth:
        return Samples(t, x, weight)
    middle, half = (t[0] + t[-1]) / 2, (t[-1] - t[0]) / 2
    if even or _is_even(Samples(t, x, weight)):
        rule, size = _even_rule(t.size), weight[0]
    else:
        rule, size = gauss_rule((t - middle) / half, weight**2), 1.0
    return Samples(middle + half * rule.nodes, rule.project @ x, size * np.sqrt(rule.weights))


def _is_even(samples: Samples) -> bool:
    """Whether all samples weigh the same and are equidistant to far below their interval."""
    t, weight = samples.t, samples.weight
    interval = (t[-1] - t[0]) / (t.size - 1)
    apart = np.abs(t - t[0] - interval * np.arange(t.size))
    return bool(np.all(weight == weight[0]) and np.all(apart < _EVEN * interval + 4e-16 * np.abs(t[-1])))


@functools.lru_cache(maxsize=256)
def _even_rule(n: int) -> Rule:
    return gauss_rule(np.linspace(-1, 1, n), np.ones(n))


def gauss_rule(place: np.ndarray, power: np.ndarray) -> Rule:
    """Gauss quadrature of the measure with weights `power` at `place`, by the orthonormal polynomials of Stieltjes."""
    diagonal, beside, basis = np.zeros(DEGREE), np.zeros(DEGREE), np.zeros((DEGREE, place.size))
    total = power.sum()
    here, before = np.full(place.size, 1 / np.sqrt(total)), np.zeros(place.size)
    for k in range(DEGREE):
        basis[k] = here
        diagonal[k] = np.sum(power * place * here**2)
        rest = (place - diagonal[k]) * here - (beside[k - 1] * before if k else 0.0)
        beside[k] = np.sqrt(np.sum(power * rest**2))
        before, here = here, rest / beside[k]
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1))
    weights = total * vectors[0] ** 2
    # Values of the orthonormal polynomials at a node are the components of its eigenvector, up to the scale.
    values = vectors / (vectors[0] * np.sqrt(total))
    return Rule(nodes, weights, values.T @ (basis * power))
