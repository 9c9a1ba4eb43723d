"""The anatomy of a free decay: hold, release, reversals, rest.

A mass pulled aside and let go swings in half-cycles, each a stroke from one standstill to the next, until friction
holds it. `segment` reads that from the samples alone, without any law of friction: it needs only that a stroke lasts
about as long as its neighbours, that strokes shrink, and that the way into a turn is never slower than the way out of
it (nothing but a hand or a magnet pushes). What follows the last stroke is rest, also where a residual creep or drift
goes on; what remains of the record without the strokes is its noise.
"""

import dataclasses
import itertools
from typing import Any

import numpy as np

from ...errors import DataError
from .disturbance import disturbance
from .half_cycles import Strokes, find_strokes
from .noise import interval, resolution, white_noise
from .release import find_rest, find_start
from .reversals import order_for, refine, window
from .swing import Swing, extremes, smooth, without_spikes, zigzag

MINIMUM_PER_HALF_CYCLE = 8
SHARES = (0.3, 0.1, 0.03, 0.01, 0.003)  # of the span: strokes this large are looked for
ALIKE = 4  # reversals between which strokes last about as long as the one behind them
AS_LONG = 0.05  # of a half-cycle: a stroke from a standstill lasts as long as the others, which puts it 1 % off at most
RISE_10_TO_90 = 0.5903344706017331  # of a half-cycle of a cosine


@dataclasses.dataclass(frozen=True)
class Segmentation:
    """What `segment` finds. Positions in the unit of x (m or rad), times in s.

    **Fields:**

    - `noise`: standard deviation of all that is not the motion: white, coloured, hum, rounding.
    - `resolution`: step of quantised data, 0.0 for none.
    - `release`: time at which the free motion starts: the end of a hold or of a guided motion, else the first sample;
      `release_position`: position there, None where the motion starts in mid-stroke.
    - `turning_times`, `turning_points`: the reversals after the release, shape `(r,)`; neither the held start nor the
      stop is among them.
    - `rest`: time of the stop, None where the record ends in motion; `rest_position`: mean position there.
    - `n_half_cycles`: completed strokes since the release, the last one (that ends in the stop) included. In a record
      that starts in mid-stroke the first, partial stroke counts.
    - `amplitude`: half the peak-to-peak motion since the release.
    - `half_period`: median duration of a stroke. `cycles`: `n_half_cycles / 2`;
      `frequency`: of the motion [Hz].
    - `white_noise`: the part of the noise that neighbouring samples do not share.
    - `lines`: frequency [Hz] and amplitude of each hum that stands out of the spectrum of the rest.
    - `drift`: slope of x over the rest [1/s], 0.0 where the rest is shorter than a cycle.
    - `open`: how many half-cycles more or less the record leaves possible, such as `(-1, 1)`; empty where it is sure.
    """

    noise: float
    resolution: float
    release: float
    turning_times: np.ndarray
    turning_points: np.ndarray
    rest: float | None
    rest_position: float | None
    n_half_cycles: int
    amplitude: float
    half_period: float
    white_noise: float = 0.0
    lines: tuple[tuple[float, float], ...] = ()
    drift: float = 0.0
    open: tuple[int, ...] = ()
    release_position: float | None = None

    @property
    def frequency(self) -> float:
        """Frequency of the motion [Hz]."""
        return 0.5 / self.half_period

    @property
    def cycles(self) -> float:
        """Completed cycles since the release."""
        return self.n_half_cycles / 2

    @property
    def n_half_cycles_after_first_reversal(self) -> int:
        """Completed strokes from the first reversal to the rest or the end of the record."""
        return max(self.n_half_cycles - 1, 0) if self.turning_times.size else 0

    @property
    def first_reversal(self) -> float | None:
        """Time of the first reversal after the release [s], None where there is none."""
        return float(self.turning_times[0]) if self.turning_times.size else None


def segment(t: Any, x: Any, sigma: Any = None, mask: Any = None) -> Segmentation:
    """Finds hold, release, reversals and rest in a trace.

    Args:
        t: times [s], shape `(n,)`, strictly increasing.
        x: displacements [m or rad], shape `(n,)`.
        sigma: stated noise of x, one number or shape `(n,)`: used only where the samples tell of none.
        mask: shape `(n,)`, True where a sample is used; None: all.

    Returns:
        A `Segmentation`.

    Raises:
        DataError: x is constant, or there are too few samples, altogether or per half-cycle.
    """
    t, x = _used_samples(t, x, mask)
    step = resolution(x)
    stated = 0.0 if sigma is None else float(np.median(np.asarray(sigma)))
    noise = white_noise(t, x, step) or stated
    _require_motion(x, noise, step)
    half_period, between = _half_period(t, x, noise, step), interval(t)
    per_half_cycle = half_period / between
    _require_density(per_half_cycle)
    width = int(per_half_cycle // 16) | 1 if per_half_cycle >= 48 else 1
    # Noise alone spans ten standard deviations in a long rest, less after smoothing.
    visible = max(10.0 * noise / width**0.5, 2.0 * step, 1e-7 * float(np.ptp(x)))
    x = without_spikes(x, max(noise, step), int(per_half_cycle))
    swing = Swing(t, x, smooth(x, width), noise, step, max(visible, 6.0 * noise), half_period, between)
    strokes = find_strokes(swing, visible)
    if strokes is None:
        raise DataError(f"x is constant within its noise ({noise:.3g}); a decay needs a motion: check the column.")
    seen = disturbance(swing, strokes)
    # Smoothing takes nothing from noise that is slow.
    slow = 10.0 * float(np.sqrt(max(seen.total**2 - noise**2, 0.0)))
    swing = dataclasses.replace(swing, noise=seen.total, threshold=max(swing.threshold, slow))
    return dataclasses.replace(_assemble(swing, strokes), white_noise=seen.white, lines=seen.lines, drift=seen.drift)


def _used_samples(t: Any, x: Any, mask: Any) -> tuple[np.ndarray, np.ndarray]:
    from ..trace import MINIMUM_SAMPLES

    t, x = np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64)
    used = np.isfinite(x) if mask is None else np.asarray(mask, dtype=bool) & np.isfinite(x)
    count = int(np.count_nonzero(used))
    if count < MINIMUM_SAMPLES:
        raise DataError(f"A trace needs at least {MINIMUM_SAMPLES} used samples, but it has {count}.")
    return (t, x) if count == x.size else (t[used], x[used])


def _require_motion(x: np.ndarray, noise: float, step: float) -> None:
    span = float(np.ptp(x))
    if span <= max(12.0 * noise, 2.5 * step, 1e-13 * float(max(x.max(), -x.min()))):
        within = "exactly" if span == 0 else f"within its noise: it spans {span:.3g} at a noise of {noise:.3g}"
        raise DataError(
            f"x is constant ({within}, about {float(x.mean()):.6g}); a decay needs a motion: "
            "check the column and the unit."
        )


def _require_density(per_half_cycle: float) -> None:
    if per_half_cycle < MINIMUM_PER_HALF_CYCLE:
        raise DataError(
            f"The record has only about {per_half_cycle:.1f} samples per half-cycle, at least {MINIMUM_PER_HALF_CYCLE} "
            "are needed to find the reversals; sample faster."
        )


def _half_period(t: np.ndarray, x: np.ndarray, noise: float, step: float) -> float:
    """Typical duration of a stroke, from the largest strokes that the trace holds at least two of."""
    span = float(np.ptp(x))
    finest = max(12.0 * noise, 4.0 * step)
    sizes = [share * span for share in SHARES if share == SHARES[0] or share * span > finest]
    pivots = zigzag(x, extremes(x, sizes[0]), sizes[0])
    if len(pivots) < 4 and len(sizes) > 1:
        from scipy.ndimage import median_filter

        # Spikes, of which two may stand side by side, are as large as small strokes.
        x = median_filter(x, 5, mode="nearest")
        among = extremes(x, sizes[-1])
        pivots = next((found for size in sizes if len(found := zigzag(x, among, size)) >= 4), pivots)
    if len(pivots) >= 4:
        return float(np.median(np.diff(t[pivots[1:-1]])))
    return _from_rise_times(t, x, pivots or [int(np.argmin(x)), int(np.argmax(x))])


def _from_rise_times(t: np.ndarray, x: np.ndarray, pivots: list[int]) -> float:
    """For one or two strokes: the time from 10 to 90 % of a stroke, free of the hold before and the rest after it."""
    pivots, durations = sorted(pivots), []
    for i, j in itertools.pairwise(pivots):
        share = (x[i : j + 1] - x[i]) / (x[j] - x[i])
        first = np.flatnonzero(share >= 0.9)[0]
        last = np.flatnonzero(share[: first + 1] <= 0.1)[-1]
        durations.append((t[i + first] - t[i + last]) / RISE_10_TO_90)
    return float(np.median(durations))


def _assemble(swing: Swing, strokes: Strokes) -> Segmentation:
    t = swing.t
    release, times = _released(swing, strokes)
    rest = position = None
    points, last = np.empty(0), times[-1:] if strokes.stopped else np.empty(0)
    times = times[: times.size - last.size]
    if times.size:
        times, points = _refined(swing, times, release, float(last[0]) if last.size else float(t[-1]))
    if last.size:
        begin = float(times[-1]) if times.size else release
        lasts = np.diff(times[-ALIKE:]) if times.size > 1 else np.array([swing.half_period])
        # An extreme is seen late where the motion ends in it: the clock is better.
        rest, position = find_rest(swing, begin, begin + float(np.median(lasts)) if times.size else float(last[0]))
    moving = swing.x[np.searchsorted(t, release) : None if rest is None else np.searchsorted(t, rest, side="right")]
    ends = times if rest is None else np.append(times, rest)
    half_period = float(np.median(np.diff(ends))) if ends.size >= 2 else swing.half_period
    from_rest = times.size > 0 and abs(float(times[0]) - release - half_period) < AS_LONG * half_period
    return Segmentation(
        noise=swing.noise,
        resolution=swing.resolution,
        release=release,
        turning_times=times,
        turning_points=points,
        rest=rest,
        rest_position=position,
        n_half_cycles=ends.size,
        amplitude=float(np.ptp([moving.min(), moving.max(), *points])) / 2,
        half_period=half_period,
        open=tuple(number - strokes.turns.size + 1 for number in strokes.open),
        release_position=float(np.interp(release, t, swing.smoothed)) if from_rest else None,
    )


def _released(swing: Swing, strokes: Strokes) -> tuple[float, np.ndarray]:
    """Time of the release [s], and instants of the reversals after it, with the stop where there is one."""
    turns = strokes.turns
    indices = np.minimum(np.searchsorted(swing.t, turns), swing.t.size - 1)
    # Before the first large stroke, up to its middle, there may be a guided motion or a part of a stroke of any size.
    middle = int(np.mean(indices[:2])) + 1 if turns.size > 1 else swing.t.size
    # The first samples are hardly smoothed, and no spike is seen in them.
    begin = min(int(0.03 * swing.half_period / swing.interval), middle - 2)
    early = swing.smoothed[begin:middle]
    head = [begin + i for i in zigzag(early, extremes(early, swing.threshold), swing.threshold)[:-1]]
    head = head or [int(indices[0])]
    end = [] if strokes.stopped else [swing.t.size - 1]
    release, pivots = find_start(swing, [*head, *indices[1:].tolist(), *end])
    before = [i for i in pivots[1:] if i in head]
    times = np.concatenate([swing.t[before], turns[1:]])
    return release, times[times > max(release, swing.t[pivots[0]]) + swing.interval]


def _refined(swing: Swing, times: np.ndarray, release: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Instant and position of each reversal between the release and the stop or the end of the record."""
    at = np.interp(np.concatenate([[release], times, [end]]), swing.t, swing.smoothed)
    sizes = np.abs(np.diff(at))
    largest, smallest = np.maximum(sizes[:-1], sizes[1:]), np.minimum(sizes[:-1], sizes[1:])
    local = np.clip(np.diff(times, prepend=release), 0.6 * swing.half_period, 1.5 * swing.half_period)
    width = window(local, largest / 2, swing.noise, swing.interval)
    order = order_for(smallest, swing.noise)
    # From afar only the simplest curve leads to the turn; its powers of time have minima of their own.
    windows = [(np.maximum(width, 0.25 * local), 2), (width, order)]
    return refine(swing.t, swing.x, times, np.pi / local, windows)
