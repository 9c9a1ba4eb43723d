"""Unwrapping: the numbers of half-cycles between initial and final displacements.

Under Coulomb and viscous friction the alternating amplitude after n half-cycles is ``a_n = rho^n a_0 - (1 + rho) x_d
S_n`` with ``S_n = (1 - rho^n)/(1 - rho)``, and the mass stops with ``-x_d < a_n <= x_s``. For a known n the problem is
linear. For an unknown n the sum of squares over the dead band x_d has as many minima as there are half-cycles, like a
periodogram. A grid of dead bands, fine enough to find every minimum, is therefore searched with the best n for each
pair. The score of a dead band is the mean square of the residuals relative to it, because wrong dead bands then scatter
evenly at any size. With an unknown scale the likelihood is the score to the power of minus half the degrees of freedom.
The sum of the other likelihoods over the best one gives the odds that the best dead band is wrong.
"""

from typing import NamedTuple

import numpy as np

from ..errors import UsageError
from ..oscillator import Oscillator

# Step of the grid of dead bands, relative to the width of a minimum of the sum of squares.
_STEP = 0.1
# Smallest dead band of the grid, relative to the largest start: about two hundred half-cycles.
_SMALLEST = 1 / 400
# Number of half-cycles that are tried; a static coefficient above the dynamic one stops the mass earlier.
_EARLIER = 3
# Largest number of alternations between counts and dead band after the grid; two or three suffice.
_ROUNDS = 8
# Score of rounding, in squares of the largest start.
_ROUNDING = 1e-26
# Standard errors from the best dead band within which another one is the same, because it changes a coefficient only
# within its noise. Half or twice this number changes the reported status in less than one campaign of twenty.
_SAME = 5.0
# Odds above which numbers of half-cycles are reported as uncertain. With this value no result of 200 campaigns of four
# pairs was wrong without a warning, at noise that leaves most of them uncertain (tests/pairs/test_scatter.py,
# experiments/honesty/routes.py).
OPEN = 1e-3


class Unwrapped(NamedTuple):
    """Number of half-cycles of each pair, with its uncertainty.

    Attributes:
        half_cycles: shape (pairs,).
        dead_band, offset: x_d and the equilibrium position [m].
        odds: odds that the pairs belong to a different dead band; zero if the numbers were given.
        doubtful: number of pairs that one half-cycle more or less fits similarly, at odds above one in a thousand.
    """

    half_cycles: np.ndarray
    dead_band: float
    offset: float
    odds: float = 0.0
    doubtful: int = 0


def decay_ratio(oscillator: Oscillator) -> float:
    """Return the amplitude ratio by damping, ``exp(-pi zeta/sqrt(1 - zeta^2))``.

    Raises:
        UsageError: an overdamped oscillator.
    """
    zeta = float(oscillator.damping_ratio)
    if not 0 <= zeta < 1:
        raise UsageError(f"Pairs need an oscillator that swings: its damping ratio must be in [0, 1), got {zeta:g}.")
    return float(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)))


def capacity_for(half_cycles: np.ndarray) -> int:
    """Return the capacity of an engine for these half-cycles.

    It is a power of two, so that few shapes are compiled.
    """
    return max(64, 2 ** int(np.ceil(np.log2(half_cycles.max() + 2))))


def amplitude_after(n: np.ndarray, a0: np.ndarray, dead_band: float | np.ndarray, rho: float) -> np.ndarray:
    """Return the alternating amplitude after `n` half-cycles from `a0` [m]."""
    return rho**n * a0 - (1 + rho) * dead_band * _sum(n, rho)


def _sum(n: np.ndarray, rho: float) -> np.ndarray:
    """Return (1 - rho^n)/(1 - rho), also for rho = 1."""
    loss = -np.log(rho)
    return np.where(loss < 1e-12, n, np.expm1(-n * loss) / np.expm1(-max(loss, 1e-12)))


def half_cycles_to_rest(a0: np.ndarray, dead_band: np.ndarray, rho: float) -> np.ndarray:
    """Return the half-cycles until the amplitude is in the dead band."""
    loss = -np.log(rho)
    if loss < 1e-12:
        count = (a0 / dead_band - 1) / 2
    else:
        centre = dead_band * (1 + rho) / (1 - rho)
        count = np.log((a0 + centre) / (dead_band + centre)) / loss
    return np.maximum(np.ceil(count - 1e-9), 0.0)


def count_half_cycles(
    x0: np.ndarray, xf: np.ndarray, half_cycles: np.ndarray | None, rho: float, offset: float | None = None
) -> Unwrapped:
    """Return dead band, offset and numbers of half-cycles.

    The numbers are as given or, for None, determined from the pairs; see `unwrap`.
    """
    if half_cycles is None:
        return unwrap(x0, xf, rho, offset)
    band, shift, _ = linear_fit(x0, xf, half_cycles, rho, offset)
    start = float(band) if band > 0 else float(np.max(np.abs(x0))) / (2 * max(int(half_cycles.max()), 1) + 1)
    return Unwrapped(half_cycles, start, float(shift))


def unwrap(x0: np.ndarray, xf: np.ndarray, rho: float, offset: float | None = None) -> Unwrapped:
    """Determine dead band, offset and numbers of half-cycles from pairs [m].

    Args:
        x0: initial displacements, shape (pairs,).
        xf: final displacements, shape (pairs,).
        rho: amplitude ratio by damping alone.
        offset: equilibrium position; None: fitted.
    """
    largest = float(np.max(np.abs(x0)))
    grid = _dead_bands(float(np.max(np.abs(x0 - (offset or 0.0)))))
    scores, candidates = _scored(x0, xf, rho, grid, np.full(grid.shape, offset or 0.0), offset)
    best = _pick(candidates, int(np.argmin(scores)))
    for _ in range(_ROUNDS):
        score, again = _scored(x0, xf, rho, np.array([best.dead_band]), np.array([best.offset]), offset)
        before, best = best, _pick(again, 0)
        if np.array_equal(before.half_cycles, best.half_cycles):
            break
    dof = x0.size - (1 if offset is not None else 2)
    if dof < 1:
        return best._replace(odds=np.inf, doubtful=x0.size)
    odds = _odds(x0, rho, best, float(score[0]), scores, candidates, offset, dof) if np.isfinite(score[0]) else np.inf
    # Count the pairs that one half-cycle more or less fits similarly, with dead band and offset refitted.
    n = best.half_cycles
    rivals = np.concatenate([n + step * np.eye(x0.size, dtype=int) for step in (1, -1)])
    floor = _ROUNDING * largest**2
    residue, *others = (max(_residue(x0, xf, counts, rho, offset), floor) for counts in (n, *rivals))
    possible = np.min(rivals, axis=-1) >= 0
    as_well = possible & ((residue / np.array(others)) ** (dof / 2) > OPEN)
    return best._replace(odds=odds, doubtful=int(np.sum(as_well.reshape(2, -1).any(axis=0))))


def _residue(x0: np.ndarray, xf: np.ndarray, n: np.ndarray, rho: float, offset: float | None) -> float:
    """Return the mean square residual of the best fit [m^2].

    Dead band and offset need not be separable.
    """
    sign, columns = (-1.0) ** n, np.stack(sensitivities(x0, n, rho, offset), axis=1)
    moved = xf - sign * rho**n * x0 - columns[:, 1] * (offset or 0.0)
    columns = columns if offset is None else columns[:, :1]
    return float(np.mean((moved - columns @ np.linalg.lstsq(columns, moved, rcond=1e-9)[0]) ** 2))


def _odds(
    x0: np.ndarray,
    rho: float,
    best: Unwrapped,
    score: float,
    scores: np.ndarray,
    candidates: tuple[np.ndarray, np.ndarray, np.ndarray],
    offset: float | None,
    dof: int,
) -> float:
    """Return the odds that the pairs belong to another dead band.

    It must differ from the best one by more than its standard error can explain.
    """
    counts, bands, _ = candidates
    score = max(score, _ROUNDING * (float(np.max(np.abs(x0))) / best.dead_band) ** 2)
    slopes = np.stack(sensitivities(x0, best.half_cycles, rho, offset)[: x0.size - dof], axis=1)
    std = best.dead_band * np.sqrt(score * x0.size / dof * np.linalg.pinv(slopes.T @ slopes)[0, 0])
    apart = np.isfinite(scores) & (np.abs(bands - best.dead_band) > _SAME * std)
    rivals = np.unique(counts[apart], axis=0, return_index=True)[1]
    return float(np.sum((score / np.maximum(scores[apart][rivals], score)) ** (dof / 2)))


def _dead_bands(largest: float) -> np.ndarray:
    """Return a grid of dead bands.

    Neighbours differ by a small part of the width of a minimum, ``x_d^2/largest``.
    """
    bands, band = [], largest
    while band > _SMALLEST * largest:
        bands.append(band)
        band -= _STEP * band * min(band / largest, 1.0)
    return np.array(bands)


def _pick(candidates: tuple[np.ndarray, np.ndarray, np.ndarray], index: int) -> Unwrapped:
    counts, bands, offsets = candidates
    return Unwrapped(counts[index].astype(int), float(bands[index]), float(offsets[index]))


def _scored(
    x0: np.ndarray, xf: np.ndarray, rho: float, bands: np.ndarray, offsets: np.ndarray, offset: float | None
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Score dead bands by mean squared relative residuals, shape (bands,).

    Returns the scores, and refined counts, dead bands and offsets.
    """
    n = _best_counts(x0 - offsets[:, None], xf - offsets[:, None], bands[:, None], rho)
    refined, shift, residual = linear_fit(x0, xf, n, rho, offset)
    usable = (refined > 0) & (refined < 2 * bands)
    band = np.where(usable, refined, bands)
    score = np.where(usable, np.mean((residual / band[:, None]) ** 2, axis=1), np.inf)
    return score, (n, band, np.where(usable, shift, offsets))


def _best_counts(y0: np.ndarray, yf: np.ndarray, band: np.ndarray, rho: float) -> np.ndarray:
    """Return the best number of half-cycles for each dead band and pair.

    It leads nearest to the final displacement.
    """
    a0, side = np.abs(y0), np.sign(y0)
    candidates = np.maximum(half_cycles_to_rest(a0, band, rho) - np.arange(_EARLIER)[:, None, None], 0.0)
    ends = (-1.0) ** candidates * side * amplitude_after(candidates, a0, band, rho)
    nearest = np.argmin(np.abs(ends - yf), axis=0)
    return np.take_along_axis(candidates, nearest[None], axis=0)[0]


def linear_fit(
    x0: np.ndarray, xf: np.ndarray, n: np.ndarray, rho: float, offset: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit dead bands and offsets for given numbers of half-cycles.

    The fit is linear least squares.

    Args:
        x0: initial displacements, shape (pairs,).
        xf: final displacements, shape (pairs,).
        n: numbers of half-cycles, shape (..., pairs).
        rho: amplitude ratio by damping alone.
        offset: equilibrium position; None: fitted.

    Returns:
        Dead bands and offsets [m], shape (...,); zero where the pairs do not determine one. Residuals [m], shape (...,
        pairs).
    """
    # Explicit normal equations, because thousands of sets of numbers are fitted at once.
    sign, (by_band, by_offset) = (-1.0) ** n, sensitivities(x0, n, rho, offset)
    shifted = xf - sign * rho**n * x0 - by_offset * (offset or 0.0)
    aa, ab, bb = (np.sum(u * v, -1) for u, v in ((by_band, by_band), (by_band, by_offset), (by_offset, by_offset)))
    al, bl = np.sum(by_band * shifted, -1), np.sum(by_offset * shifted, -1)
    if offset is not None:
        band = np.divide(al, aa, out=np.zeros_like(aa), where=aa > 0)
        return band, np.full(band.shape, offset), shifted - band[..., None] * by_band
    rest = aa * bb - ab**2
    known = rest > 1e-9 * aa * bb
    band = np.divide(al * bb - bl * ab, rest, out=np.zeros_like(rest), where=known)
    shift = np.divide(bl * aa - al * ab, rest, out=np.zeros_like(rest), where=known)
    return band, shift, shifted - band[..., None] * by_band - shift[..., None] * by_offset


def sensitivities(x0: np.ndarray, n: np.ndarray, rho: float, offset: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives of the final displacements by dead band and offset."""
    side, sign = np.sign(x0 - (offset or 0.0)), (-1.0) ** n
    return -sign * side * (1 + rho) * _sum(n, rho), 1 - sign * rho**n
