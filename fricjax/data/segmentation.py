"""The anatomy of a free decay: hold, release, reversals, rest.

A mass pulled aside and let go swings in half-cycles, each a stroke from one standstill to the next, until friction
holds it. `segment` reads that from the samples alone, without any law of friction: it needs only that a stroke lasts
about as long as its neighbours, starts slowly, and that the way into a turn is never slower than the way out of it
(nothing but a hand or a magnet pushes). What follows the last such stroke is rest, also where a residual creep or
drift goes on.
"""

import dataclasses
import itertools
from typing import Any

import numpy as np

from .errors import DataError
from .noise import interval, resolution, white_noise
from .rest import find_rest
from .reversals import refine, window
from .start import find_start
from .swing import Swing, extremes, smooth, zigzag
from .trace import MINIMUM_SAMPLES

MINIMUM_PER_HALF_CYCLE = 8
SHARES = (0.3, 0.1, 0.03, 0.01, 0.003)  # of the span: strokes this large are looked for
RISE_10_TO_90 = 0.5903344706017331  # of a half-cycle of a cosine


@dataclasses.dataclass(frozen=True)
class Segmentation:
    """What `segment` finds. Positions in the unit of x (m or rad), times in s.

    **Fields:**

    - `noise`: standard deviation of the white noise of x.
    - `resolution`: step of quantised data, 0.0 for none.
    - `release`: time at which the free motion starts: the end of a hold or of a guided motion, else the first sample.
    - `turning_times`, `turning_points`: the reversals after the release, shape `(r,)`; neither the held start nor the
      stop is among them.
    - `rest`: time of the stop, None where the record ends in motion; `rest_position`: mean position there.
    - `n_half_cycles`: completed strokes since the release, the last one (that ends in the stop) included. In a record
      that starts in mid-stroke the first, partial stroke counts.
    - `amplitude`: half the peak-to-peak motion since the release.
    - `half_period`: median duration of a stroke. `cycles`: `n_half_cycles / 2`.
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
        sigma: stated noise of x, one number or shape `(n,)`; used only where the samples tell of none.
        mask: shape `(n,)`, True where a sample is used; None: all.

    Returns:
        A `Segmentation`. Strokes smaller than six times the noise (ten times in sparse records) or twice the
        resolution are not reported.

    Raises:
        DataError: x is constant, or there are too few samples, altogether or per half-cycle.
    """
    t, x = _used_samples(t, x, mask)
    step = resolution(x)
    noise = white_noise(t, x, step) or (0.0 if sigma is None else float(np.median(np.asarray(sigma))))
    _require_motion(x, noise, step)
    half_period, between = _half_period(t, x, noise, step), interval(t)
    per_half_cycle = half_period / between
    _require_density(per_half_cycle)
    width = int(per_half_cycle // 16) | 1 if per_half_cycle >= 48 else 1
    # Noise alone spans ten standard deviations in a long rest, less after smoothing.
    threshold = max(6.0 * noise, 10.0 * noise / width**0.5, 2.0 * step, 1e-7 * float(np.ptp(x)))
    return _assemble(Swing(t, x, smooth(x, width), noise, threshold, half_period, between), step)


def _used_samples(t: Any, x: Any, mask: Any) -> tuple[np.ndarray, np.ndarray]:
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
    among, pivots = extremes(x, sizes[-1]), []
    for size in sizes:
        pivots = zigzag(x, among, size)
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


def _assemble(swing: Swing, step: float) -> Segmentation:
    among = extremes(swing.smoothed, swing.threshold)
    pivots = zigzag(swing.smoothed, among, swing.threshold)
    if not pivots:
        raise DataError(
            f"x is constant within its noise ({swing.noise:.3g}); a decay needs a motion: check the column."
        )
    release, pivots = find_start(swing, pivots)
    rest, position, pivots = find_rest(swing, pivots)
    times, points = _refined(swing, pivots)
    since = int(np.searchsorted(swing.t, release))
    until = swing.t.size if rest is None else int(np.searchsorted(swing.t, rest, side="right"))
    moving = swing.x[since:until]
    ends = times if rest is None else np.append(times, rest)
    return Segmentation(
        noise=swing.noise,
        resolution=step,
        release=release,
        turning_times=times,
        turning_points=points,
        rest=rest,
        rest_position=position,
        n_half_cycles=ends.size,
        amplitude=float(np.ptp([moving.min(), moving.max(), *points])) / 2,
        half_period=float(np.median(np.diff(ends))) if ends.size >= 2 else swing.half_period,
    )


def _refined(swing: Swing, pivots: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Instant and position of each reversal; `pivots` leads with the start and ends with the open or last stroke."""
    if len(pivots) < 3:
        return np.empty(0), np.empty(0)
    t, at = swing.t[pivots], swing.smoothed[pivots]
    sizes = np.abs(np.diff(at))
    largest, smallest = np.maximum(sizes[:-1], sizes[1:]), np.minimum(sizes[:-1], sizes[1:])
    local = np.clip(np.diff(t)[:-1], 0.6 * swing.half_period, 1.5 * swing.half_period)
    width = window(local, largest / 2, swing.noise, swing.interval)
    order = np.where(smallest > 1e3 * swing.noise, 4, 2)
    return refine(swing.t, swing.x, t[1:-1], np.pi / local, [np.maximum(width, 0.2 * local), width], order)
