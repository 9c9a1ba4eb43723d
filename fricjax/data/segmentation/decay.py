"""Segmentation of a free decay: hold, release, reversals, rest.

A mass that is pulled aside and released swings in half-cycles, each between two states at rest, until friction holds
it. `segment` finds them without a friction law. It assumes only that a half-cycle lasts about as long as its
neighbours, that half-cycles shrink, and that the mass never approaches a reversal more slowly than it leaves it, unless
a hand or a magnet pushes. The time after the last half-cycle is rest, even if a slow creep or drift continues. The
record without the half-cycles is its noise.
"""

import dataclasses
import itertools
from typing import Any

import numpy as np

from ...errors import DataError, UsageError
from ...numbers import real
from .disturbance import disturbance
from .half_cycles import HalfCycles, find_half_cycles
from .noise import resolution, typical_interval, white_noise
from .release import locate_release, locate_rest
from .reversals import order_for, refine, window
from .swing import PreparedTrace, extremes, smooth, without_spikes, zigzag

MINIMUM_PER_HALF_CYCLE = 8
STANDS_OUT = 12.0  # span of a motion in standard deviations of the noise
ALTERNATE = 0.9  # share of alternating moves, between the two thirds of white noise and the whole of turning points
SHARES = (0.3, 0.1, 0.03, 0.01, 0.003)  # sizes of half-cycles to search for, relative to the span
ALIKE = 4  # number of last reversals that predict the duration of the next half-cycle
# Relative tolerance of the duration of a first half-cycle from rest; it then gives the start position within 1 %.
AS_LONG = 0.05
RISE_10_TO_90 = 0.5903344706017331  # duration of the rise from 10 to 90 % of a cosine, in half-cycles


@dataclasses.dataclass(frozen=True)
class Segmentation:
    """Result of `segment`: positions in the unit of x, times in s.

    The unit of x is m or rad.

    **Fields:**

    - `noise`: standard deviation of everything except the motion: white and coloured noise, hum, rounding.
    - `resolution`: step of quantised data, 0.0 for none.
    - `release`: start of the free motion: the end of a hold or of a guided motion, or the first sample;
      `release_position`: position there, None if the record starts within a half-cycle.
    - `turning_times`, `turning_points`: the reversals after the release, shape `(r,)`; they exclude the start of a held
      mass and the stop.
    - `rest`: time of the stop, None if the record ends in motion; `rest_position`: mean position there.
    - `n_half_cycles`: completed half-cycles since the release, including the last one, which ends in the stop. If the
      record starts within a half-cycle, this partial half-cycle counts.
    - `amplitude`: half the peak-to-peak motion since the release.
    - `half_period`: median duration of a half-cycle. `cycles`: `n_half_cycles / 2`;
      `frequency`: of the motion [Hz].
    - `white_noise`: the white part of the noise.
    - `lines`: frequency [Hz] and amplitude of each hum line in the spectrum of the rest.
    - `drift`: slope of x over the rest [1/s], 0.0 if the rest is shorter than a cycle.
    - `open`: alternative numbers of half-cycles, relative to `n_half_cycles`, such as `(-1, 1)`; empty if the number is
      certain.
    - `gain`: reading over displacement, 1 unless the record is a velocity, an acceleration or a projection. Then
      `noise`, `white_noise`, `resolution`, `lines` and `drift` are those of the reading, divided by it.

    Examples:
        >>> import fricjax as fj
        >>> segmentation = fj.read(fj.data.example_paths().run).segmentation
        >>> segmentation.n_half_cycles, round(segmentation.frequency, 2), round(segmentation.release, 3)
        (13, 12.6, 0.051)
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
    gain: float = 1.0

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
        """Completed half-cycles after the first reversal."""
        return max(self.n_half_cycles - 1, 0) if self.turning_times.size else 0

    @property
    def first_reversal(self) -> float | None:
        """Time of the first reversal after the release [s], None without one."""
        return float(self.turning_times[0]) if self.turning_times.size else None


def segment(t: Any, x: Any, sigma: Any = None, mask: Any = None) -> Segmentation:
    """Find hold, release, reversals and rest in a trace.

    Args:
        t: times [s], shape `(n,)`, strictly increasing.
        x: displacements [m or rad], shape `(n,)`.
        sigma: stated noise of x, one number or shape `(n,)`; used only if the samples show no noise.
        mask: shape `(n,)`, True where a sample is used; None: all.

    Returns:
        A `Segmentation`.

    Raises:
        DataError: x is constant, or there are too few samples, altogether or per half-cycle.

    Examples:
        A cosine that friction stops after one half-cycle, with noise of 1 nm:

        >>> import numpy as np
        >>> from fricjax.data import segment
        >>> t = np.arange(4000) / 1000
        >>> x = 1e-3 * np.where(t < 1, 1 + 2 * np.cos(np.pi * t), -1)
        >>> segmentation = segment(t, x + 1e-9 * np.random.default_rng(0).standard_normal(t.size))
        >>> segmentation.n_half_cycles, round(segmentation.rest, 3), round(segmentation.rest_position, 6)
        (1, 1.0, -0.001)
    """
    # Import late: the trace imports JAX, and a refused record should not wait for it.
    from ..trace import MINIMUM_SAMPLES

    t, x = real("t", t, "a list of times"), real("x", x, "a list of displacements")
    if t.ndim != 1 or t.shape != x.shape:
        raise UsageError(f"t and x must have one entry for each sample, but their shapes are {t.shape} and {x.shape}.")
    used = np.isfinite(x) if mask is None else np.asarray(mask, dtype=bool) & np.isfinite(x)
    count = int(np.count_nonzero(used))
    if count < MINIMUM_SAMPLES:
        raise DataError(f"A trace needs at least {MINIMUM_SAMPLES} used samples, but it has {count}.")
    if count < x.size:
        t, x = t[used], x[used]
    step = resolution(x)
    noise = white_noise(t, x, step) or (0.0 if sigma is None else float(np.median(np.asarray(sigma))))
    between, span = typical_interval(t), float(np.ptp(x))
    if span <= max(2.5 * step, 1e-13 * float(max(x.max(), -x.min()))):
        within = "exactly" if span == 0 else f"within its resolution of {step:.3g}"
        raise DataError(_constant(x, within))
    _check_alternation(x)
    fewest, coarse, noise_left = 1, x, noise
    # Average until the motion stands out from white noise, which spans less than nine standard deviations.
    while (seen := float(np.ptp(coarse[fewest // 2 : coarse.size - fewest // 2]))) <= STANDS_OUT * noise_left:
        fewest = 2 * fewest + 1
        if fewest > x.size // MINIMUM_PER_HALF_CYCLE:
            raise DataError(_constant(x, f"within its noise: it spans {span:.3g} at a noise of {noise:.3g}"))
        coarse, noise_left = smooth(t, x, fewest, between), noise / fewest**0.5
    half_period = _half_period(t, coarse, noise_left, step)
    _check_gaps(t, half_period)
    per_half_cycle = half_period / between
    if per_half_cycle < MINIMUM_PER_HALF_CYCLE:
        raise DataError(
            f"The record has only about {per_half_cycle:.1f} samples per half-cycle, at least {MINIMUM_PER_HALF_CYCLE} "
            "are needed to find the reversals; sample faster."
        )
    width = max(int(per_half_cycle // 16) | 1 if per_half_cycle >= 48 else 1, fewest)
    # Noise alone spans ten standard deviations in a long rest, and less after smoothing.
    visible = max(10.0 * noise / width**0.5, 2.0 * step, 1e-7 * seen)
    x = without_spikes(t, x, max(noise, step), between, int(per_half_cycle))
    smoothed = smooth(t, x, width, between)
    trace = PreparedTrace(t, x, smoothed, noise, step, max(visible, 6.0 * noise), half_period, between)
    half_cycles = find_half_cycles(trace, visible)
    if half_cycles is None:
        raise DataError(f"x is constant within its noise ({noise:.3g}); a decay needs a motion: check the column.")
    noise = white_noise(t, x, step, half_cycles.edges) or noise
    trace = dataclasses.replace(trace, noise=noise)
    # With the motion known, the full noise can be measured, not only its white part.
    total, drift, lines = disturbance(trace, half_cycles)
    # Smoothing does not reduce slow noise.
    slow = 10.0 * float(np.sqrt(max(total**2 - noise**2, 0.0)))
    trace = dataclasses.replace(trace, noise=total, threshold=max(trace.threshold, slow))
    segmentation = _refined_segmentation(trace, half_cycles)
    return dataclasses.replace(segmentation, white_noise=noise, lines=lines, drift=drift)


def _constant(x: np.ndarray, within: str) -> str:
    return (
        f"x is constant ({within}, about {float(x.mean()):.6g}); a decay needs a motion: check the column and the unit."
    )


def _check_alternation(x: np.ndarray) -> None:
    """Refuse a record that holds its turning points only."""
    moves = np.diff(x)
    if x.size < MINIMUM_PER_HALF_CYCLE or np.mean(moves[1:] * moves[:-1] < 0) <= ALTERNATE:
        return
    sizes = np.abs(moves)
    # Neighbouring half-cycles are nearly as large; of white noise, one in three does not alternate.
    if np.median(np.abs(np.diff(sizes)) / np.maximum(sizes[1:], np.finfo(float).tiny)) < 0.5:
        raise DataError(
            "x changes sides from sample to sample: the record holds its turning points only, or two samples per "
            "cycle. A fit needs the motion between them: sample faster."
        )


def _check_gaps(t: np.ndarray, half_period: float) -> None:
    """Refuse a gap that holds more half-cycles than the record has samples."""
    last = int(np.argmax(np.diff(t)))
    gap = float(t[last + 1] - t[last])
    if gap > t.size * half_period:
        raise DataError(
            f"The clock jumps by {gap:.6g} s after {t[last]:.9g} s (sample {last + 1} of {t.size}): it was set, or a "
            "time is wrong. Read it with repair='clock', or crop it there."
        )


def _half_period(t: np.ndarray, x: np.ndarray, noise: float, step: float) -> float:
    """Return the typical duration of a half-cycle [s].

    It is measured on the largest half-cycles that occur at least twice.
    """
    span = float(np.ptp(x))
    finest = max(12.0 * noise, 4.0 * step)
    sizes = [share * span for share in SHARES if share == SHARES[0] or share * span > finest]
    pivots = zigzag(x, extremes(x, sizes[0]), sizes[0])
    if len(pivots) < 4 and len(sizes) > 1:
        from scipy.ndimage import median_filter

        # Spikes, even two neighbouring ones, can be as large as small half-cycles.
        x = median_filter(x, 5, mode="nearest")
        among = extremes(x, sizes[-1])
        pivots = next((more for size in sizes if len(more := zigzag(x, among, size)) >= 4), pivots)
        # The filter may have removed extremes that were spikes.
        pivots = pivots if np.all(np.diff(x[pivots])) else zigzag(x, among, sizes[0])
    if len(pivots) >= 4:
        return float(np.median(np.diff(t[pivots[1:-1]])))
    # One or two half-cycles: use the rise from 10 to 90 % of each, which excludes hold and rest.
    durations = []
    for i, j in itertools.pairwise(sorted(pivots or [int(np.argmin(x)), int(np.argmax(x))])):
        share = (x[i : j + 1] - x[i]) / (x[j] - x[i])
        first = np.flatnonzero(share >= 0.9)[0]
        last = np.flatnonzero(share[: first + 1] <= 0.1)[-1]
        durations.append((t[i + first] - t[i + last]) / RISE_10_TO_90)
    return float(np.median(durations))


def _refined_segmentation(trace: PreparedTrace, half_cycles: HalfCycles) -> Segmentation:
    """Refine release, reversals and stop to a fraction of the noise."""
    t = trace.t
    release, times = _release_and_reversals(trace, half_cycles)
    rest = position = None
    points, last = np.empty(0), times[-1:] if half_cycles.stopped else np.empty(0)
    times = times[: times.size - last.size]
    if times.size:
        times, points = _refined(trace, times, release, float(last[0]) if last.size else float(t[-1]))
    if last.size:
        begin = float(times[-1]) if times.size else release
        durations = np.diff(times[-ALIKE:]) if times.size > 1 else np.array([trace.half_period])
        # An extreme is detected late if the motion ends there, so predict the stop from the period.
        rest, position = locate_rest(
            trace, begin, begin + float(np.median(durations)) if times.size else float(last[0])
        )
    moving = trace.x[np.searchsorted(t, release) : None if rest is None else np.searchsorted(t, rest, side="right")]
    if not moving.size:
        raise DataError(
            "No motion is seen between release and rest, as where spikes hide it: mask them, or crop them off."
        )
    ends = times if rest is None else np.append(times, rest)
    half_period = float(np.median(np.diff(ends))) if ends.size >= 2 else trace.half_period
    from_rest = times.size > 0 and abs(float(times[0]) - release - half_period) < AS_LONG * half_period
    return Segmentation(
        noise=trace.noise,
        resolution=trace.resolution,
        release=release,
        turning_times=times,
        turning_points=points,
        rest=rest,
        rest_position=position,
        n_half_cycles=ends.size,
        amplitude=float(np.ptp([moving.min(), moving.max(), *points])) / 2,
        half_period=half_period,
        open=tuple(number - half_cycles.edges.size + 1 for number in half_cycles.open),
        release_position=float(np.interp(release, t, trace.smoothed)) if from_rest else None,
    )


def _release_and_reversals(trace: PreparedTrace, half_cycles: HalfCycles) -> tuple[float, np.ndarray]:
    """Return the release [s] and the times of the reversals after it.

    If the mass stops, the last time is the stop.
    """
    edges = half_cycles.edges
    indices = np.minimum(np.searchsorted(trace.t, edges), trace.t.size - 1)
    # Before the middle of the first large half-cycle there may be a guided motion or a partial half-cycle of any size.
    # Earlier oscillations come from a hand or from noise during the hold, because half-cycles of a free mass shrink.
    middle = int(np.mean(indices[:2])) + 1 if edges.size > 1 else trace.t.size
    # Smoothing hardly affects the first samples, and spikes are not detected there.
    begin = max(min(int(np.searchsorted(trace.t, trace.t[0] + 0.03 * trace.half_period)), middle - 2), 0)
    early = trace.smoothed[begin:middle]
    head = [begin + i for i in zigzag(early, extremes(early, trace.threshold), trace.threshold)[:-1]]
    head = head[-2:] or [int(indices[0])]
    end = [] if half_cycles.stopped else [trace.t.size - 1]
    release, pivots = locate_release(trace, [*head, *indices[1:].tolist(), *end])
    before = [i for i in pivots[1:] if i in head]
    times = np.concatenate([trace.t[before], edges[1:]])
    return release, times[times > max(release, trace.t[pivots[0]]) + trace.interval]


def _refined(trace: PreparedTrace, times: np.ndarray, release: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Refine time and position of each reversal between release and stop."""
    at = np.interp(np.concatenate([[release], times, [end]]), trace.t, trace.smoothed)
    sizes = np.abs(np.diff(at))
    largest, smallest = np.maximum(sizes[:-1], sizes[1:]), np.minimum(sizes[:-1], sizes[1:])
    local = np.clip(np.diff(times, prepend=release), 0.6 * trace.half_period, 1.5 * trace.half_period)
    width = window(local, largest / 2, trace.noise, trace.interval)
    order = order_for(smallest, trace.noise)
    # Far from the reversal only the simplest curve is safe: higher powers of time add further minima.
    wide = np.maximum(width, 0.25 * local)
    # A reversal within a gap follows from the rest of both half-cycles.
    gaps = np.flatnonzero(np.diff(trace.t) > max(0.5 * float(wide.min()), 4 * trace.interval))
    covered = np.clip(trace.t[[gaps, gaps + 1]], (times - wide)[:, None, None], (times + wide)[:, None, None])
    hidden = np.max(np.diff(covered, axis=1)[:, 0], axis=1, initial=0.0) > 0.5 * wide
    wide, width = (np.where(hidden, 0.75 * local, each) for each in (wide, width))
    windows = [(wide, np.where(hidden, order, 2)), (width, order)]
    return refine(trace.t, trace.x, times, np.pi / local, windows)
