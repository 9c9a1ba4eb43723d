"""The strokes of a decaying swing, found by its clock and its decrement, and the stop as the one change in them.

A threshold on neighbouring samples cannot tell a stroke from the noise of an instrument, which is coloured, hums and
is rounded. What can is the order of a decay: its large strokes give the half-period, and the clock goes on from there.
Every further half-period of the record is asked for the stroke that would belong there, a half-cosine in the direction
whose turn it is. Up to the stop these strokes are those of a decay, ``alpha rho^j - beta``; behind it they are what the
noise alone gives, of whatever colour, and so tell themselves how large that is: one change point, by likelihood
(Hinkley, Biometrika 57, 1970).
"""

import bisect
from typing import NamedTuple

import numpy as np

from .noise import NORMAL_MAD
from .swing import Swing, extremes, zigzag

# Part of the span from which a stroke is seen without any clock: far above any noise in which friction could be told.
SURE = 0.1
# How far about the predicted reversal it is sought, and how far from there it is believed, in half-periods.
SOUGHT, BELIEVED = 0.2, 0.12
# Part of the stroke before at which a stroke is taken for the last one by the clock, which then runs on by itself.
TINY = 0.02
# Standard errors by which a stroke stands out, and how many strokes in a row are to do so.
STANDS_OUT, TOGETHER = 5.0, 3
# A stroke is no larger than the one before, but for what noise of slow colour adds to it.
GROWTH = 1.3
# Strokes from the pole on that may last any time, for a hand may lead or hold the mass.
STEADY = 3
# Strokes over which a swing falls below this part of itself, and a hum stays above that.
HUMS, FELL, STEADILY = 3, 0.75, 0.9
# Standard errors within which a period does not depend on the amplitude; durations that can tell it.
ISOCHRONOUS, DURATIONS = 4.0, 6
# Averages per stroke that tell its size; variance beside a half-cosine, as a part of what the rest has at most, at
# which a contact rings.
PER_STROKE, RINGING = 256, 4.0
# Part of a stroke that is left of it and the next half-period together, below which it is a creep.
CREPT = 0.35
# Part of a half-period behind the last reversal from which a rest can be told from a turn.
SHORTEST_REST = 0.25
# Speed of a creep, as a part of the peak speed of the last stroke.
CREEP = 0.03
# Twice the logarithm of the likelihood ratio up to which another number of strokes stays possible: odds of 400 to 1.
OPEN = 12.0
# Strokes by which a prediction is made at least, strokes that judge it, and how many more than stand out are looked at.
_FITTED, _JUDGES, _AHEAD = 5, 8, 16
_TOLD = 6  # strokes from the end of the record
_FINEST = 2e-8  # of the span: strokes below five times this are not looked for
_DECREMENTS = np.exp(-np.concatenate([-np.geomspace(0.05, 1e-4, 10), [0.0], np.geomspace(1e-4, 1.5, 60)]))[:, None]
_VARIANCE = 0.125  # of a half-cosine of height one


class Strokes(NamedTuple):
    """The strokes of a record.

    **Fields:**

    - `turns`: instants at which they begin and end [s]: the pole from which the motion starts, the reversals, and the
      stop where there is one, shape `(n + 1,)`.
    - `stopped`: whether the mass comes to rest; otherwise the record ends in motion.
    - `open`: other numbers of strokes that the record leaves possible.
    """

    turns: np.ndarray
    stopped: bool
    open: tuple[int, ...]


def find_strokes(swing: Swing, visible: float) -> Strokes | None:
    """The strokes of a record, None where it never moves; the noise left after smoothing spans less than `visible`."""
    share = max(SURE * float(np.ptp(swing.smoothed)), visible)
    pivots = zigzag(swing.smoothed, extremes(swing.smoothed, share), share)
    if not pivots:
        return None
    turns = _large(swing, pivots)
    if turns.size < 2:
        return Strokes(turns, False, ())
    large, period = turns.size - 1, _small_period(swing, turns)
    side = float(np.sign(np.subtract(*np.interp(turns[[-1, -2]], swing.t, swing.smoothed))))
    turns = _by_clock(swing, turns, side, period)
    size, error, misfit = _sizes(swing, turns, side * (-1.0) ** (np.arange(turns.size - 1) - large + 1))
    return _until_the_stop(swing, turns, size, error, misfit, large)


def _large(swing: Swing, pivots: list[int]) -> np.ndarray:
    """Instants of the pole and of the reversals between large strokes; missing samples hide none of them."""
    t = swing.t
    if len(pivots) == 2:
        half = _middle(swing, *pivots)
        ends = half + 0.5 * swing.half_period * np.array([-1.0, 1.0])
        # The mass may have been held, or go on to creep.
        return np.maximum(ends, t[0])[: 2 if ends[1] + SHORTEST_REST * swing.half_period <= t[-1] else 1]
    turns = t[pivots[:-1]]
    if turns.size > 1:
        side = float(np.sign(np.subtract(*swing.smoothed[[pivots[-2], pivots[-3]]])))
        turns[-1] = _reversal(swing, float(turns[-1]), swing.half_period, side)
    # Strokes near the smallest size are seen here and missed there: the clock goes on from the first one missed.
    missed = np.flatnonzero(np.diff(turns)[STEADY:] > 2 * np.diff(turns)[STEADY - 1 : -1])
    turns = turns[: STEADY + 1 + int(missed[0])] if missed.size else turns
    holes = t[:-1][np.diff(t) > 0.5 * swing.half_period]
    hidden = np.searchsorted(turns, holes)
    for i in np.unique(hidden[(hidden > 0) & (hidden < turns.size)])[::-1]:
        # Extremes alternate, so that an even number of them is missing.
        missing = 2 * round(float((turns[i] - turns[i - 1]) / swing.half_period - 1) / 2)
        turns = np.insert(turns, i, np.linspace(turns[i - 1], turns[i], missing + 2)[1:-1])
    return turns


def _middle(swing: Swing, begin: int, end: int) -> float:
    """When the mass is half-way through a lone stroke [s]."""
    way = swing.smoothed[begin : end + 1] - swing.smoothed[begin]
    return float(swing.t[begin + int(np.argmax(np.abs(way) >= 0.5 * np.abs(way[-1])))])


def _small_period(swing: Swing, turns: np.ndarray) -> float:
    """Duration of the strokes behind those seen [s]: their mean, or, where it goes with the size, the last one's."""
    lasts = np.diff(turns)[1:] if turns.size > 2 else np.array([swing.half_period])
    at = np.interp(turns, swing.t, swing.smoothed)
    weight = np.abs(np.diff(at))[-lasts.size :]
    mean = float(np.average(lasts, weights=weight**2))
    if lasts.size < DURATIONS:
        return mean
    # The duration of a pendulum's strokes goes with the square of their size.
    square = weight**2 - np.average(weight**2, weights=weight**2)
    slope = np.sum(weight**2 * square * lasts) / np.sum(weight**2 * square**2)
    left = lasts - mean - slope * square
    slope_error = np.sqrt(np.sum(weight**2 * left**2) / (lasts.size - 2) / np.sum(weight**2 * square**2))
    return float(mean + slope * square[-1]) if abs(slope) > ISOCHRONOUS * slope_error else mean


def _by_clock(swing: Swing, turns: np.ndarray, side: float, period: float) -> np.ndarray:
    """The reversals followed by those that the clock predicts up to the end of the record, each moved to its extreme.

    Where there is no extreme near the prediction, as in the rest, the clock is believed.
    """
    t, x, found = swing.t, swing.smoothed, list(turns)
    places, runs = np.interp(turns, t, x).tolist(), False
    while found[-1] + period <= t[-1]:
        at, side = found[-1] + period, -side
        # Behind a stroke this small there is none to be followed, and wiggles of the rest are not to set the clock.
        runs = runs or abs(np.interp(at, t, x) - places[-1]) < TINY * abs(places[-1] - places[-2])
        if not runs:
            at = _reversal(swing, at, period, side)
        found.append(at)
        places.append(float(np.interp(at, t, x)))
    return np.array(found)


def _reversal(swing: Swing, at: float, period: float, side: float) -> float:
    """The extreme nearest a predicted instant [s], a maximum for a positive `side`; the prediction for none near."""
    t, x, reach = swing.t, swing.smoothed, SOUGHT * period
    near = slice(*np.searchsorted(t, [at - reach, at + reach]))
    every = (near.stop - near.start) // 128 + 1
    u, y = (t[near][::every] - at) / reach, x[near][::every]
    if u.size < 5:
        return at
    y, square = y - y.mean(), u * u
    # Least squares of a parabola on times that lie about as far on either side.
    slope = float(u @ y) / float(square.sum())
    square -= square.mean()
    curve = float(square @ y) / float(square @ square)
    shift = -slope / (2 * curve) if side * curve < 0 else np.inf
    # Friction bends a reversal as hard as the strokes on either side are large, so that a parabola comes too late: by
    # 3/8 of the reach, the ratio of the mean of |u|^3 to twice that of u^2, times their difference over their sum.
    here, before, after = np.interp([at, at - period, at + period], t, x)
    seen = 0.5 - 0.5 * np.cos(np.pi * np.clip((t[-1] - at) / period, SOUGHT, 1.0))
    strokes = abs(here - before), abs(after - here) / seen
    shift -= 0.375 * np.subtract(*strokes) / max(np.sum(strokes), swing.threshold)
    return at + reach * shift if abs(shift) * SOUGHT <= BELIEVED else at


def _sizes(swing: Swing, turns: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Size of the half-cosine in each stroke, its standard error in white noise, and the variance left beside it."""
    cell = int(swing.half_period / swing.interval) // PER_STROKE + 1
    length = swing.t.size // cell * cell
    t, x = (values[:length].reshape(-1, cell).mean(axis=1) for values in (swing.t, swing.x))
    edges = np.searchsorted(t, turns)
    count = np.diff(edges).astype(float)
    used = slice(edges[0], edges[-1])
    number = np.repeat(np.arange(count.size), np.diff(edges))
    t, x = t[used], x[used] - x[used].mean()
    shape = 0.5 - 0.5 * np.cos(np.pi * (t - turns[number]) / (turns[number + 1] - turns[number]))

    def sums(values: np.ndarray) -> np.ndarray:
        return np.bincount(number, values, minlength=count.size)

    n = np.maximum(count, 1.0)
    first, second = sums(shape) / n, sums(x) / n
    h, y = shape - first[number], x - second[number]
    square, product = sums(h * h), sums(h * y)
    seen = (count >= 4) & (square > 0.02 * count)
    size = np.where(seen, product / np.where(seen, square, 1.0), 0.0)
    misfit = np.maximum(sums(y * y) - size * product, 0.0) / n
    return side * size, swing.noise / np.sqrt(_VARIANCE * cell * n), misfit


def _until_the_stop(
    swing: Swing, turns: np.ndarray, size: np.ndarray, error: np.ndarray, misfit: np.ndarray, large: int
) -> Strokes:
    # A creep or a drift moves the mass as far in the next half-period, and is no stroke in the sum of both.
    pairs = np.append(size[:-1] + size[1:], size[-1])
    floor = np.maximum(np.maximum(error, swing.resolution / np.sqrt(12)), _FINEST * float(np.ptp(swing.smoothed)))
    scatter = _scatter(pairs, floor, misfit)
    last = _decaying(size, floor, large)
    other = _is_no_stroke(pairs, size, misfit)
    while last > large and (
        other[last - 1] or np.any(pairs[max(last - TOGETHER, 0) : last] <= STANDS_OUT * scatter[last - 1])
    ):
        last -= 1
    if last == size.size:
        moved = abs(swing.smoothed[-1] - np.interp(turns[-1], swing.t, swing.smoothed))
        sets_out = moved > max(swing.threshold, STANDS_OUT * scatter[-1])
        lasts, period = swing.t[-1] - turns[-1], turns[-1] - turns[-2]
        # Too soon after the last turn a stop cannot be told from it, unless the mass is seen on its way again.
        if lasts < SHORTEST_REST * period:
            return Strokes(turns if sets_out else turns[:-1], False, ())
        if sets_out and moved / lasts > CREEP * np.pi / period * abs(size[-1]) / 2:
            return Strokes(turns, False, ())
    likelihoods = _likelihoods(size, pairs, scatter, other, last, large)
    best = max(likelihoods, key=lambda number: likelihoods[number])
    near = [n for n, value in likelihoods.items() if n != best and 2 * (likelihoods[best] - value) < OPEN]
    return Strokes(turns[: best + 1], True, tuple(sorted(near)))


def _decaying(size: np.ndarray, floor: np.ndarray, large: int) -> int:
    """How many strokes from the first on go to and fro and shrink."""
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
    """What noise makes of a pair of strokes, for each stroke as if those behind it were the rest; few tell it badly.

    It is their median size: of a long slow decay most strokes behind one that is seen are lost in the noise. Where
    they are too few to tell, it is at most what is left beside them, as if that were slow.
    """
    scatter, behind = np.sqrt(2) * floor, []
    few = slice(max(pairs.size - _TOLD, 0), None)
    left = np.maximum.accumulate(np.append(misfit[1:], misfit[-1])[few][::-1])[::-1]
    scatter[few] = np.maximum(scatter[few], np.sqrt(left))
    for j in range(pairs.size - 3, -1, -1):
        bisect.insort(behind, abs(float(pairs[j + 1])))
        rest = behind[len(behind) // 2] / NORMAL_MAD * (1 + 2 / len(behind))
        scatter[j] = max(scatter[j], rest)
    return scatter


def _is_no_stroke(pairs: np.ndarray, size: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """Which moves are a creep, that goes on where a stroke ends and is lost in the pair, or the ring of a contact."""
    quiet = np.append(np.maximum.accumulate(misfit[::-1])[::-1][1:], 0.0)
    return (pairs < CREPT * size) | (misfit > np.maximum(_VARIANCE * size**2, RINGING * quiet))


def _likelihoods(
    size: np.ndarray, pairs: np.ndarray, scatter: np.ndarray, other: np.ndarray, last: int, large: int
) -> dict[int, float]:
    """Logarithm of the likelihood of each number of strokes near `last`, up to a constant.

    A stroke is as large as the decay predicts, or anything up to the one before where too few predict it. It is seen
    together with the next one, if there is one, so that a creep or a drift is not taken for it.
    """
    from scipy.special import log_ndtr

    # The last stroke of all has none behind it that could tell it from a creep.
    first, end = max(last - 1, large, 1), max(min(size.size - 1, last + _AHEAD), last)
    moved = other[last:end] & (size[last:end] > STANDS_OUT * scatter[last:end])
    end = last + int(np.argmax(moved)) if moved.any() else end
    # Too few behind a stroke tell the noise badly: those that have more stand for them.
    noise, seen = scatter[np.minimum(np.arange(first, end), max(size.size - _TOLD, last))], pairs[first:end]
    still = -0.5 * (seen / noise) ** 2 - np.log(noise)
    if last >= _FITTED + 1:
        curve, misfit = _prediction(size[:last], end)
        alone, spread = np.maximum(curve, 0.0), np.hypot(noise, misfit)
        both = alone[first:end] + np.append(alone, 0.0)[first + 1 : end + 1]

        def log_density(predicted: np.ndarray) -> np.ndarray:
            return -0.5 * ((seen - predicted) / spread) ** 2 - np.log(spread)

        going, ending = log_density(both), log_density(curve[first:end])
    else:
        height = np.maximum(size[last - 1], STANDS_OUT * noise)
        going = ending = log_ndtr(seen / noise) + 0.5 * np.log(2 * np.pi) - np.log(height)
    return {
        number: float(np.sum(going[: max(i - 1, 0)]) + np.sum(ending[max(i - 1, 0) : i]) + np.sum(still[i:]))
        for i, number in enumerate(range(first, end + 1))
    }


def _prediction(size: np.ndarray, end: int) -> tuple[np.ndarray, float]:
    """Strokes ``alpha rho^j - beta`` fitted to those seen, but for the first, up to number `end`; and their misfit."""
    j = np.arange(end, dtype=float)
    # Each counted from where it is largest among the strokes seen, so that none overflows.
    largest = np.where(_DECREMENTS < 1.0, 1, size.size)
    curves = np.where(_DECREMENTS == 1.0, j, np.power(_DECREMENTS, j - largest))
    fitted = slice(1, size.size)
    bent, seen = curves[:, fitted], size[fitted]
    middle, mean = bent.mean(axis=1, keepdims=True), seen.mean()
    slope = (bent - middle) @ (seen - mean) / np.sum((bent - middle) ** 2, axis=1)
    predicted = mean + slope[:, None] * (curves - middle)
    best = predicted[np.argmin(np.sum((predicted[:, fitted] - seen) ** 2, axis=1))]
    left = (size - best[: size.size])[fitted][-_JUDGES:]
    return best, float(np.sqrt(np.sum(left**2) / max(left.size - 3, 1)))
