"""What a run does not determine, in words: the null space of the information matrix as products, ratios and sums.

Along a null direction several parameters change together and the motion stays as it is. In relative changes such a
direction has small whole numbers where a product or a ratio is all that counts, and in absolute changes where a sum is.
The null space has many bases; the one with the fewest parameters in each direction is the one that people talk of.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..estimation.covariance import WEAKEST
from ..estimation.space import Parameter
from ..show import engineering, plain

NO_EFFECT = 1e-12
"""Part of the strongest parameter's effect below which a parameter has none."""

# Part of the largest entry of a direction that is rounding, and the condition from which pivots depend on each other.
_ROUNDING, _DEPENDENT = 1e-4, 1e6
# Distance from an integer that still counts as one, and the largest exponent that reads as a law.
_INTEGER, _LARGEST = 1e-3, 6.0


class Direction(NamedTuple):
    """A combination of parameters that a run does not determine.

    Attributes:
        names: the parameters that take part.
        changes: how they change together, in their own units, the first one by its own size; shape (names,).
        text: the same in words.
        simple: whether it is a product, a ratio or a sum.

    Examples:
        >>> import fricjax as fj
        >>> oscillator = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> information = fj.sensitivity.fisher(oscillator, 1e-3, names=["mu", "normal_force"])
        >>> information.singular[0].text
        'mu and normal_force only as a product'
    """

    names: tuple[str, ...]
    changes: np.ndarray
    text: str
    simple: bool


class Spectrum(NamedTuple):
    """Eigenvalues of the information matrix scaled to a unit diagonal, without the parameters that have no effect.

    Attributes:
        active: parameters that have an effect, shape (p,).
        rank: number of directions that the run determines.
        condition: ratio of the largest to the smallest singular value of the scaled derivatives; inf where the run
            leaves a direction undetermined.
        null: basis of the undetermined directions in coordinates, shape (directions, p).
    """

    active: np.ndarray
    rank: int
    condition: float
    null: np.ndarray


def spectrum(normal: np.ndarray) -> Spectrum:
    """The spectrum of a normal matrix ``J'J``, shape (p, p)."""
    size = np.sqrt(np.diag(normal))
    active = size > NO_EFFECT * size.max(initial=0.0)
    unit = size[active]
    values, vectors = np.linalg.eigh(normal[np.ix_(active, active)] / np.outer(unit, unit))
    weak = values < WEAKEST * values[-1:]
    null = np.zeros((int(weak.sum()), size.size))
    null[:, active] = vectors[:, weak].T / unit
    condition = np.inf if weak.any() or not values.size else float(np.sqrt(values[-1] / values[0]))
    return Spectrum(active, int(np.sum(~weak)), condition, null)


def directions(null: np.ndarray, parameters: Sequence[Parameter]) -> tuple[Direction, ...]:
    """The undetermined directions of a spectrum, each in words and with as few parameters as possible."""
    if not null.size:
        return ()
    strength = np.linalg.norm(null, axis=0)
    candidates = np.flatnonzero(strength > _ROUNDING * strength.max()).tolist()
    dimensionless = {parameter.name for parameter in parameters if not parameter.unit}
    # Bases in which each of the pivots takes part in one direction alone, with one as its entry.
    bases = [
        _rounded(np.linalg.solve(null[:, list(pivots)], null))
        for pivots in itertools.combinations(candidates, len(null))
        if np.linalg.cond(null[:, pivots]) < _DEPENDENT
    ]

    def effort(basis: np.ndarray) -> tuple[int, int, int]:
        """How hard it is to read: directions without a simple law, then entries, then those without a unit."""
        read = [_direction(row, parameters) for row in basis]
        used = [name for direction in read for name in direction.names]
        return sum(not d.simple for d in read), len(used), sum(name in dimensionless for name in used)

    best = min(bases, key=effort)
    return tuple(_simplest(best, i, parameters) for i in range(len(best)))


def _rounded(basis: np.ndarray) -> np.ndarray:
    return np.where(np.abs(basis) < _ROUNDING * np.abs(basis).max(axis=-1, keepdims=True), 0.0, basis)


def _simplest(basis: np.ndarray, index: int, parameters: Sequence[Parameter]) -> Direction:
    """A direction of the basis, with others added or taken away where only that makes it a product, ratio or sum."""
    factors = itertools.product((0.0, 1.0, -1.0), repeat=len(basis))
    mixed = (np.where(np.arange(len(basis)) == index, 1.0, factor) @ basis for factor in factors)
    read = (_direction(_rounded(row), parameters) for row in mixed)
    return next((direction for direction in read if direction.simple), _direction(basis[index], parameters))


def _direction(row: np.ndarray, parameters: Sequence[Parameter]) -> Direction:
    """One direction with its words; `row` is in coordinates, that is in sizes of the parameters.

    Parameters without a unit come first.
    """
    part = sorted(np.flatnonzero(row).tolist(), key=lambda i: bool(parameters[i].unit))
    chosen = [parameters[i] for i in part]
    relative = row[part] / row[part[0]]
    absolute = relative * [parameter.scale for parameter in chosen]
    names, text = [parameter.name for parameter in chosen], None
    if len(chosen) == 2 and len({p.unit for p in chosen}) == 1 and abs(abs(absolute[1] / absolute[0]) - 1) <= _INTEGER:
        text = f"{joined(names)} only as a {'sum' if absolute[0] * absolute[1] < 0 else 'difference'}"
    elif all(parameter.start for parameter in chosen):
        powers = relative / np.min(np.abs(relative))
        nearest = np.round(powers)
        if np.all(np.abs(powers - nearest) < _INTEGER) and np.max(np.abs(nearest)) <= _LARGEST:
            text = _as_product(names, nearest)
    return Direction(tuple(names), absolute, text or _as_trade(chosen, absolute), text is not None)


def _as_product(names: Sequence[str], powers: np.ndarray) -> str | None:
    """Parameters whose products or ratios alone count; `powers` are those of a common factor that changes nothing."""
    same = [name for name, power in zip(names, powers, strict=True) if power * powers[0] > 0]
    opposite = [name for name in names if name not in same]
    if np.any(np.abs(powers) != 1):
        if len(names) != 2:
            return None
        # What changes nothing as s^a and s^b leaves x^b/y^a.
        exponents = int(abs(powers[1])), int(abs(powers[0]))
        x, y = (name if n == 1 else f"{name}^{n}" for name, n in zip(names, exponents, strict=True))
        return f"{joined(names)} only as {x} {'*' if opposite else '/'} {y}"
    if not opposite:
        return f"{joined(names)} only in ratio"
    if len(names) == 2:
        return f"{joined(names)} only as a product"
    fewer, more = sorted((same, opposite), key=len)
    if len(fewer) == 1:
        return f"{joined(more)} only as products with {fewer[0]}"
    return f"{joined(same)} only in ratio, and {joined(opposite)} only as products with them"


def _as_trade(parameters: Sequence[Parameter], absolute: np.ndarray) -> str:
    """Any other combination, by an example of what undoes what."""
    changes = absolute / 100 * np.sign(absolute[0])
    first, *others = zip(parameters, changes, strict=True)
    lead = f"+1 % of {first[0].name}" if first[0].start else f"{_signed(*first)} of {first[0].name}"
    undone = joined([f"{_signed(p, change)} of {p.name}" for p, change in others])
    verb = "go" if len(others) > 1 else "goes"
    return f"{joined([p.name for p in parameters])} only together: {undone} {verb} unseen with {lead}"


def _signed(parameter: Parameter, change: float) -> str:
    size = engineering(abs(change), parameter.unit) if parameter.unit else plain(abs(change), 3)
    return f"{'-' if change < 0 else '+'}{size}"


def joined(names: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
