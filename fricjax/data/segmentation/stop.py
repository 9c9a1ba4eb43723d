"""The stop of a decay: the change point in its half-cycles.

Up to the stop the half-cosines in the record follow a decay, ``alpha rho^j - beta``. After it they come from the noise
alone, of any colour, and so measure its size. The number of half-cycles before this single change point is estimated by
likelihood (Hinkley, Biometrika 57, 1970).
"""

import bisect

import numpy as np

from ... import thresholds
from .noise import NORMAL_MAD
from .swing import PreparedTrace

# Standard errors by which a half-cycle stands out, and the number in a row that must stand out.
STANDS_OUT, TOGETHER = 5.0, 3
# Largest ratio of a half-cycle to the previous one; slow noise can add to a half-cycle.
GROWTH = 1.3
# Over this many half-cycles a decay falls below a share FELL of its size, while a hum stays above a share STEADILY.
HUMS, FELL, STEADILY = 3, 0.75, 0.9
# Residual variance of a half-cosine, relative to the largest one at rest, above which the contact rings.
RINGING = 4.0
# Ratio of a half-cycle plus its successor to the half-cycle alone, below which the motion is a creep.
CREPT = 0.35
# Shortest time after the last reversal that separates a rest from a reversal, in half-periods.
SHORTEST_REST = 0.25
# Speed of a creep, relative to the peak speed of the last half-cycle.
CREEP = 0.03
COSINE_VARIANCE = 0.125
"""Variance of a half-cosine of height one."""
# Fewest half-cycles for a prediction, half-cycles that measure its misfit, and number of candidates beyond those that
# stand out.
_FITTED, _MISFITS, _AHEAD = 5, 8, 16
_FEW = 6  # half-cycles from the end of the record, too few to measure the noise after them
_FINEST = 2e-8  # relative to the span; half-cycles below five times this size are ignored
# Trial ratios rho; a ratio above 1, with a negative alpha, is a decay that becomes faster and faster.
_DECREMENTS = np.exp(-np.concatenate([-np.geomspace(0.05, 1e-4, 10), [0.0], np.geomspace(1e-4, 1.5, 60)]))[:, None]


def find_stop(
    trace: PreparedTrace, edges: np.ndarray, size: np.ndarray, error: np.ndarray, misfit: np.ndarray, large: int
) -> tuple[int, bool, tuple[int, ...]]:
    """Return the number of half-cycles, the stop flag, and alternatives.

    Args:
        trace: the prepared trace.
        edges: times between which half-cycles are searched [s], shape `(n + 1,)`.
        size: size of the half-cosine in each, positive in the expected direction, shape `(n,)`.
        error: its standard error in white noise.
        misfit: residual variance of the half-cosine.
        large: number of half-cycles that are certainly motion.

    Returns:
        The number of half-cycles, True if the mass stops after them, and other possible numbers.
    """
    # A creep or a drift moves the mass as far in the next half-period, so it cancels in the sum of both.
    pairs = np.append(size[:-1] + size[1:], size[-1])
    floor = np.maximum(np.maximum(error, trace.resolution / np.sqrt(12)), _FINEST * float(np.ptp(trace.smoothed)))
    scatter = _scatter(pairs, floor, misfit)
    last = _decaying(size, floor, large)
    # Motion that is no half-cycle: a creep, which continues and cancels in the pair, or the ringing of a contact.
    quiet = np.append(np.maximum.accumulate(misfit[::-1])[::-1][1:], 0.0)
    other = (pairs < CREPT * size) | (misfit > np.maximum(COSINE_VARIANCE * size**2, RINGING * quiet))
    while last > large and (
        other[last - 1] or np.any(pairs[max(last - TOGETHER, 0) : last] <= STANDS_OUT * scatter[last - 1])
    ):
        last -= 1
    if last == size.size:
        moved = abs(trace.smoothed[-1] - np.interp(edges[-1], trace.t, trace.smoothed))
        sets_out = moved > max(trace.threshold, STANDS_OUT * scatter[-1])
        since, period = trace.t[-1] - edges[-1], edges[-1] - edges[-2]
        # Too soon after the last reversal a stop looks the same as a reversal, unless the mass has visibly left it.
        if since < SHORTEST_REST * period:
            return size.size if sets_out else size.size - 1, False, ()
        if sets_out and moved / since > CREEP * np.pi / period * abs(size[-1]) / 2:
            return size.size, False, ()
    likelihoods = _likelihoods(size, pairs, scatter, other, last, large)
    best = max(likelihoods, key=lambda number: likelihoods[number])
    least = likelihoods[best] - thresholds.DECISIVE / 2
    return best, True, tuple(sorted(n for n, value in likelihoods.items() if n != best and value > least))


def _decaying(size: np.ndarray, floor: np.ndarray, large: int) -> int:
    """Return the number of half-cycles from the first that alternate and shrink."""
    grown = size[large:] > GROWTH * size[large - 1 : -1] + STANDS_OUT * floor[large:]
    wrong = np.flatnonzero(grown | (size[large:] < -STANDS_OUT * floor[large:]))
    if wrong.size:
        return large + int(wrong[0])
    # A hum at the natural frequency alternates forever, and does not shrink as the decay did.
    if large <= HUMS or size.size < large + 2 * HUMS:
        return size.size
    recent, earlier = (float(np.mean(size[-n * HUMS :][:HUMS])) for n in (1, 2))
    hums = size[large - 1] < FELL * size[large - 1 - HUMS] and recent > STEADILY * earlier
    return large + int(np.argmax(size[large:] < 2 * recent)) if hums else size.size


def _scatter(pairs: np.ndarray, floor: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """Estimate the noise of each pair of half-cycles from later pairs.

    It is their median size, which is robust: in a long slow decay most half-cycles after a detected one are below the
    noise. Near the end, where few pairs are left, the residual variance is a lower bound, as if it were slow noise.
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
    """Return the log-likelihood of each number of half-cycles near `last`.

    The values share an unknown constant. A half-cycle is as large as the decay predicts. If too few half-cycles predict
    it, its size is anything up to the previous one. Each half-cycle is tested together with the next one, if there is
    one, so that a creep or a drift does not count.
    """
    # The last half-cycle of all has no successor to distinguish it from a creep.
    first, end = max(last - 1, large, 1), max(min(size.size - 1, last + _AHEAD), last)
    moved = other[last:end] & (size[last:end] > STANDS_OUT * scatter[last:end])
    end = last + int(np.argmax(moved)) if moved.any() else end
    # Few half-cycles measure the noise badly, so use the noise of those with more half-cycles after them.
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
        # Import late: the import takes longer than a fit, and only short decays need it.
        from scipy.special import log_ndtr

        height = np.maximum(size[last - 1], STANDS_OUT * noise)
        moving = ending = log_ndtr(seen / noise) + 0.5 * np.log(2 * np.pi) - np.log(height)
    return {
        number: float(np.sum(moving[: max(i - 1, 0)]) + np.sum(ending[max(i - 1, 0) : i]) + np.sum(at_rest[i:]))
        for i, number in enumerate(range(first, end + 1))
    }


def _prediction(size: np.ndarray, end: int) -> tuple[np.ndarray, float]:
    """Fit sizes ``alpha rho^j - beta``, without the first, and extrapolate.

    Returns the sizes up to number `end` and the misfit.
    """
    j = np.arange(end, dtype=float)
    # Scale each curve to its largest fitted value, so that no power overflows.
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
