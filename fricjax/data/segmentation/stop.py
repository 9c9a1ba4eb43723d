"""Where a decay stops, as the one change in its half-cycles.

Up to the stop the half-cosines in the record are those of a decay, ``alpha rho^j - beta``; after it they are what the
noise alone makes, of whatever colour, and so say themselves how large that is: one change point, by likelihood
(Hinkley, Biometrika 57, 1970).
"""

import bisect

import numpy as np

from ... import thresholds
from .noise import NORMAL_MAD
from .swing import Swing

# Standard errors by which a half-cycle stands out, and how many in a row have to.
STANDS_OUT, TOGETHER = 5.0, 3
# A half-cycle is no larger than the one before, but for what noise of slow colour adds to it.
GROWTH = 1.3
# Half-cycles over which a swing falls below this part of itself, and a hum stays above that.
HUMS, FELL, STEADILY = 3, 0.75, 0.9
# Variance beside a half-cosine, as a multiple of the most that the rest has, at which a contact rings.
RINGING = 4.0
# Part of a half-cycle that is left of it and the next half-period together, below which it is a creep.
CREPT = 0.35
# Part of a half-period after the last reversal from which a rest can be told from a reversal.
SHORTEST_REST = 0.25
# Speed of a creep, as a part of the peak speed of the last half-cycle.
CREEP = 0.03
COSINE_VARIANCE = 0.125
"""Variance of a half-cosine of height one."""
# Half-cycles from which a prediction is made at least, half-cycles that give its misfit, and how many more than those
# that stand out are weighed.
_FITTED, _MISFITS, _AHEAD = 5, 8, 16
_FEW = 6  # half-cycles from the end of the record, too few to measure the noise after them
_FINEST = 2e-8  # of the span: half-cycles below five times this are not looked for
# Ratios rho that are tried; those above 1, with a negative alpha, are decays that fall faster and faster.
_DECREMENTS = np.exp(-np.concatenate([-np.geomspace(0.05, 1e-4, 10), [0.0], np.geomspace(1e-4, 1.5, 60)]))[:, None]


def find_stop(
    swing: Swing, edges: np.ndarray, size: np.ndarray, error: np.ndarray, misfit: np.ndarray, large: int
) -> tuple[int, bool, tuple[int, ...]]:
    """How many of the half-cycles are motion, whether the mass stops after them, and what other numbers are possible.

    Args:
        swing: the record.
        edges: instants between which half-cycles are looked for [s], shape `(n + 1,)`.
        size: of the half-cosine in each, positive in the direction whose turn it is, shape `(n,)`.
        error: its standard error in white noise.
        misfit: variance beside the half-cosine.
        large: how many are motion for sure.
    """
    # A creep or a drift moves the mass as far in the next half-period, and is no half-cycle in the sum of both.
    pairs = np.append(size[:-1] + size[1:], size[-1])
    floor = np.maximum(np.maximum(error, swing.resolution / np.sqrt(12)), _FINEST * float(np.ptp(swing.smoothed)))
    scatter = _scatter(pairs, floor, misfit)
    last = _decaying(size, floor, large)
    # No half-cycle: a creep, that goes on where one ends and is lost in the pair, or the ring of a contact.
    quiet = np.append(np.maximum.accumulate(misfit[::-1])[::-1][1:], 0.0)
    other = (pairs < CREPT * size) | (misfit > np.maximum(COSINE_VARIANCE * size**2, RINGING * quiet))
    while last > large and (
        other[last - 1] or np.any(pairs[max(last - TOGETHER, 0) : last] <= STANDS_OUT * scatter[last - 1])
    ):
        last -= 1
    if last == size.size:
        moved = abs(swing.smoothed[-1] - np.interp(edges[-1], swing.t, swing.smoothed))
        sets_out = moved > max(swing.threshold, STANDS_OUT * scatter[-1])
        since, period = swing.t[-1] - edges[-1], edges[-1] - edges[-2]
        # Too soon after the last reversal a stop cannot be told from it, unless the mass is seen on its way again.
        if since < SHORTEST_REST * period:
            return size.size if sets_out else size.size - 1, False, ()
        if sets_out and moved / since > CREEP * np.pi / period * abs(size[-1]) / 2:
            return size.size, False, ()
    likelihoods = _likelihoods(size, pairs, scatter, other, last, large)
    best = max(likelihoods, key=lambda number: likelihoods[number])
    least = likelihoods[best] - thresholds.DECISIVE / 2
    return best, True, tuple(sorted(n for n, value in likelihoods.items() if n != best and value > least))


def _decaying(size: np.ndarray, floor: np.ndarray, large: int) -> int:
    """How many half-cycles from the first on go to and fro and shrink."""
    grown = size[large:] > GROWTH * size[large - 1 : -1] + STANDS_OUT * floor[large:]
    wrong = np.flatnonzero(grown | (size[large:] < -STANDS_OUT * floor[large:]))
    if wrong.size:
        return large + int(wrong[0])
    # A hum at the natural frequency goes to and fro for ever, and does not shrink where the swing did.
    if large <= HUMS or size.size < large + 2 * HUMS:
        return size.size
    level, before = (float(np.mean(size[-n * HUMS :][:HUMS])) for n in (1, 2))
    hums = size[large - 1] < FELL * size[large - 1 - HUMS] and level > STEADILY * before
    return large + int(np.argmax(size[large:] < 2 * level)) if hums else size.size


def _scatter(pairs: np.ndarray, floor: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """What noise makes of a pair of half-cycles, for each as if those after it were the rest; few measure it badly.

    It is their median size: of a long slow decay most half-cycles after one that is seen are lost in the noise. Where
    they are too few, it is at most what is left beside them, as if that were slow.
    """
    scatter, after = np.sqrt(2) * floor, []
    few = slice(max(pairs.size - _FEW, 0), None)
    slow = np.maximum.accumulate(np.append(misfit[1:], misfit[-1])[few][::-1])[::-1]
    scatter[few] = np.maximum(scatter[few], np.sqrt(slow))
    for j in range(pairs.size - 3, -1, -1):
        bisect.insort(after, abs(float(pairs[j + 1])))
        rest = after[len(after) // 2] / NORMAL_MAD * (1 + 2 / len(after))
        scatter[j] = max(scatter[j], rest)
    return scatter


def _likelihoods(
    size: np.ndarray, pairs: np.ndarray, scatter: np.ndarray, other: np.ndarray, last: int, large: int
) -> dict[int, float]:
    """Logarithm of the likelihood of each number of half-cycles near `last`, up to a constant.

    A half-cycle is as large as the decay predicts, or anything up to the one before where too few predict it. It is
    seen together with the next one, if there is one, so that a creep or a drift is not taken for it.
    """
    # The last half-cycle of all has none after it that could tell it from a creep.
    first, end = max(last - 1, large, 1), max(min(size.size - 1, last + _AHEAD), last)
    moved = other[last:end] & (size[last:end] > STANDS_OUT * scatter[last:end])
    end = last + int(np.argmax(moved)) if moved.any() else end
    # Too few after a half-cycle measure the noise badly: those that have more stand for them.
    noise, seen = scatter[np.minimum(np.arange(first, end), max(size.size - _FEW, last))], pairs[first:end]
    at_rest = -0.5 * (seen / noise) ** 2 - np.log(noise)
    if last >= _FITTED + 1:
        curve, misfit = _prediction(size[:last], end)
        alone, spread = np.maximum(curve, 0.0), np.hypot(noise, misfit)
        both = alone[first:end] + np.append(alone, 0.0)[first + 1 : end + 1]

        def log_density(predicted: np.ndarray) -> np.ndarray:
            return -0.5 * ((seen - predicted) / spread) ** 2 - np.log(spread)

        moving, ending = log_density(both), log_density(curve[first:end])
    else:
        # Imported where a decay is that short, for it takes longer than a fit.
        from scipy.special import log_ndtr

        height = np.maximum(size[last - 1], STANDS_OUT * noise)
        moving = ending = log_ndtr(seen / noise) + 0.5 * np.log(2 * np.pi) - np.log(height)
    return {
        number: float(np.sum(moving[: max(i - 1, 0)]) + np.sum(ending[max(i - 1, 0) : i]) + np.sum(at_rest[i:]))
        for i, number in enumerate(range(first, end + 1))
    }


def _prediction(size: np.ndarray, end: int) -> tuple[np.ndarray, float]:
    """Sizes ``alpha rho^j - beta`` fitted to those seen, but for the first, up to number `end`; and their misfit."""
    j = np.arange(end, dtype=float)
    # Each counted from where it is largest among those seen, so that none overflows.
    largest = np.where(_DECREMENTS < 1.0, 1, size.size)
    curves = np.where(_DECREMENTS == 1.0, j, np.power(_DECREMENTS, j - largest))
    fitted = slice(1, size.size)
    shapes, seen = curves[:, fitted], size[fitted]
    middle, mean = shapes.mean(axis=1, keepdims=True), seen.mean()
    slope = (shapes - middle) @ (seen - mean) / np.sum((shapes - middle) ** 2, axis=1)
    predicted = mean + slope[:, None] * (curves - middle)
    best = predicted[np.argmin(np.sum((predicted[:, fitted] - seen) ** 2, axis=1))]
    residual = (size - best[: size.size])[fitted][-_MISFITS:]
    return best, float(np.sqrt(np.sum(residual**2) / max(residual.size - 3, 1)))
