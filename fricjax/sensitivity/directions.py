"""Undetermined directions of the information matrix as products, ratios and sums.

Along a null direction several parameters change together without an effect on the motion. If a run determines only a
product or a ratio, the relative changes along the direction are small integers. If it determines only a sum, the
absolute changes are. The null space has many bases. This module chooses the one with the fewest parameters in each
direction, which is the easiest to read.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..estimation.covariance import WEAKEST
from ..estimation.space import Parameter
from ..show import engineering, plain

NO_EFFECT = 1e-12
"""Smallest effect of a parameter, as a fraction of the strongest one."""

# Rounding error of a direction, as a fraction of its largest entry, and condition of dependent pivots.
_ROUNDING, _DEPENDENT = 1e-4, 1e6
# Tolerance of an integer, and largest exponent of a product.
_INTEGER, _LARGEST = 1e-3, 6.0


class Direction(NamedTuple):
    """A combination of parameters that a run does not determine.

    Attributes:
        names: the parameters of the combination.
        changes: changes along the direction in SI units, shape (names,); the first one is the size of its parameter.
        text: the direction in words.
        simple: True for a product, a ratio or a sum.

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
    """Spectrum of the information matrix, scaled to a unit diagonal.

    Parameters without an effect are left out.

    Attributes:
        active: True for parameters with an effect, shape (p,).
        rank: number of directions that the run determines.
        condition: ratio of the largest to the smallest singular value of the scaled derivatives; inf if the run does
            not determine a direction.
        null: basis of the undetermined directions in coordinates, shape (directions, p).
    """

    active: np.ndarray
    rank: int
    condition: float
    null: np.ndarray


def spectrum(normal: np.ndarray) -> Spectrum:
    """Return the spectrum of a normal matrix ``J'J``, shape (p, p)."""
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
    """Return undetermined directions with as few parameters as possible."""
    if not null.size:
        return ()
    strength = np.linalg.norm(null, axis=0)
    candidates = np.flatnonzero(strength > _ROUNDING * strength.max()).tolist()
    dimensionless = {parameter.name for parameter in parameters if not parameter.unit}
    # In each basis every pivot belongs to one direction only, with an entry of one.
    bases = [
        _rounded(np.linalg.solve(null[:, list(pivots)], null))
        for pivots in itertools.combinations(candidates, len(null))
        if np.linalg.cond(null[:, pivots]) < _DEPENDENT
    ]

    def effort(basis: np.ndarray) -> tuple[int, int, int]:
        """Return a rank: complex directions, entries, dimensionless entries."""
        read = [_direction(row, parameters) for row in basis]
        used = [name for direction in read for name in direction.names]
        return sum(not d.simple for d in read), len(used), sum(name in dimensionless for name in used)

    best = min(bases, key=effort)
    return tuple(_simplest(best, i, parameters) for i in range(len(best)))


def _rounded(basis: np.ndarray) -> np.ndarray:
    return np.where(np.abs(basis) < _ROUNDING * np.abs(basis).max(axis=-1, keepdims=True), 0.0, basis)


def _simplest(basis: np.ndarray, index: int, parameters: Sequence[Parameter]) -> Direction:
    """Return a direction of the basis in its simplest form.

    Other directions are added or subtracted if only that makes it a product, a ratio or a sum.
    """
    factors = itertools.product((0.0, 1.0, -1.0), repeat=len(basis))
    mixed = (np.where(np.arange(len(basis)) == index, 1.0, factor) @ basis for factor in factors)
    read = (_direction(_rounded(row), parameters) for row in mixed)
    return next((direction for direction in read if direction.simple), _direction(basis[index], parameters))


def _direction(row: np.ndarray, parameters: Sequence[Parameter]) -> Direction:
    """Describe one direction; `row` is in sizes of the parameters.

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
    """Describe parameters of a determined product or ratio.

    Args:
        names: the parameters.
        powers: power of a common factor in each, which has no effect on the motion.
    """
    same = [name for name, power in zip(names, powers, strict=True) if power * powers[0] > 0]
    opposite = [name for name in names if name not in same]
    if np.any(np.abs(powers) != 1):
        if len(names) != 2:
            return None
        # Factors s^a and s^b have no effect, so x^b/y^a is determined.
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
    """Describe any other combination by an example."""
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
    """Join names as ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
