"""The half-cycles of a record, each by itself: the samples between one reversal and the next.

Friction jumps at every reversal, and the holding magnet may still pull before the first one. What an evaluation by
energy or force may use are therefore the strokes from the first reversal on, none of which knows of its neighbours.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ..data import Record, Segmentation
from ..data.gather import gather
from ..data.record import labels
from ..data.segmentation.reversals import order_for, point_std, window
from ..errors import DataError, UsageError
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..rig import Rig

EVEN = 1e-3  # largest deviation of a sampling interval from the mean one, relative
DENSE = 2000  # samples per half-cycle; denser ones are averaged in blocks, which loses nothing that friction tells
MINIMUM = 16  # samples in a stroke


@dataclasses.dataclass(frozen=True, eq=False)
class Stroke:
    """One half-cycle.

    Attributes:
        t: times of its samples [s], shape (n,), all within the stroke.
        x: positions [m], shape (n,).
        step: sampling interval [s].
        noise: standard deviation of x [m].
        direction: +1 or -1, the sign of the velocity.
        begin, end: times of the reversals at either end [s].
    """

    t: np.ndarray
    x: np.ndarray
    step: float
    noise: float
    direction: int
    begin: float
    end: float


@dataclasses.dataclass(frozen=True, eq=False)
class Decay:
    """A record as its strokes since the first reversal.

    Attributes:
        strokes: the half-cycles, the last one ends in the stop where there is one.
        times, points: reversals and stop, where a stroke begins or ends: times [s] and positions [m], shape (r,).
        point_std: standard uncertainty of `points` from the noise [m], shape (r,).
        found: the anatomy of the whole record.
    """

    strokes: tuple[Stroke, ...]
    times: np.ndarray
    points: np.ndarray
    point_std: np.ndarray
    found: Segmentation


def machine(rig: Rig, *, damping_known: bool = True) -> Oscillator:
    """The rig without friction: mass, restoring force, damping and drag.

    Args:
        rig: the rig.
        damping_known: whether its damping is needed as well.

    Raises:
        UsageError: no rig, or one without damping although its loss must be told from that of friction.
    """
    if not isinstance(rig, Rig):
        raise UsageError(f"rig must be a fricjax.Rig, got {type(rig).__name__}. Read one with Rig.from_toml(path).")
    if damping_known and rig.damping is None and rig.damping_ratio is None:
        raise UsageError(
            "The rig has no damping, so that its viscous loss would count as friction. Give the rig its damping "
            "or damping_ratio (0 for none), or a no-contact run."
        )
    return rig.oscillator(Coulomb(0.0))


def each_of[T](records: Any, evaluate: Callable[[Any], T]) -> tuple[list[T], tuple[str, ...]]:
    """What `evaluate` makes of one record or of several; those of several that cannot be used are left out and named.

    Args:
        records: a run, or a list of runs, each given as to :func:`fricjax.fit`.
        evaluate: what is made of a record; raises a `DataError` for one that cannot be used.

    Returns:
        The results, and a sentence for each record left out.

    Raises:
        UsageError: no run at all, or something of which no record can be made.
        DataError: a single record that cannot be used, or none of several.
    """
    runs = gather(records)
    if len(runs) == 1:
        return [evaluate(runs[0])], ()
    found, notes = [], []
    for label, run in zip(labels([run.name for run in runs]), runs, strict=True):
        try:
            found.append(evaluate(run))
        except DataError as error:
            notes.append(f"Left out {label}: {error}")
    if not found:
        raise DataError(f"None of the {len(runs)} records can be used. {notes[0]}")
    return found, tuple(notes)


def decay(record: Record, least: int = 2) -> Decay:
    """The strokes of a record from its first reversal on.

    Raises:
        DataError: uneven sampling, no reversal, or fewer than `least` half-cycles after the first reversal.
    """
    t, x = np.asarray(record.t, float), np.asarray(record.x, float)
    step = _even_step(t, record.mask)
    found = record.segmentation
    times, points = _ends(found, least)
    noise = _noise(record, found)
    pairs = zip(times[:-1], times[1:], np.sign(np.diff(points)).astype(int), strict=True)
    strokes = tuple(_stroke(t, x, begin, end, direction, step, noise) for begin, end, direction in pairs)
    resting = 0.0 if found.rest is None else max((t[-1] - found.rest) / step, 1.0)
    return Decay(strokes, times, points, _point_std(times, points, noise, step, resting), found)


def _even_step(t: np.ndarray, mask: np.ndarray) -> float:
    """The sampling interval [s].

    Raises:
        DataError: intervals that differ, or samples left out.
    """
    steps = np.diff(t)
    step, worst = float(np.mean(steps)), float(np.max(np.abs(steps - np.mean(steps))))
    if worst > EVEN * step:
        raise DataError(
            f"Velocities need even sampling, but intervals differ by up to {100 * worst / step:.2g} % of {step:.4g} s; "
            "resample the record, or use fricjax.fit, which takes any times."
        )
    if not mask.all():
        raise DataError(
            f"Velocities need even sampling without gaps, but {int((~mask).sum())} samples are masked out; fill or "
            "crop them, or use fricjax.fit, which fits around gaps."
        )
    return step


def _ends(found: Segmentation, least: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions at which strokes begin and end: the reversals, and the stop."""
    times, points = found.turning_times, found.turning_points
    if not times.size:
        raise DataError(
            "The motion never turns round, so that there is no half-cycle between two reversals; release the mass "
            "from farther away."
        )
    if found.rest is not None and found.rest_position is not None:
        times, points = np.append(times, found.rest), np.append(points, found.rest_position)
    if times.size <= least:
        raise DataError(
            f"Half-cycles after the first reversal: {times.size - 1}. At least {least} are needed, one in either "
            "direction tells friction from the equilibrium; release the mass from farther away."
        )
    return times, points


def _noise(record: Record, found: Segmentation) -> float:
    """Standard deviation of a sample [m]: the stated one, else the one found; never zero."""
    stated = found.noise if record.sigma is None else float(np.median(record.sigma))
    return max(stated, 1e-12 * found.amplitude)


def _stroke(
    t: np.ndarray, x: np.ndarray, begin: float, end: float, direction: int, step: float, noise: float
) -> Stroke:
    """The samples between two reversals; where they are many, as averages of blocks."""
    first, last = np.searchsorted(t, [begin, end])
    size = last - first
    if size < MINIMUM:
        raise DataError(
            f"The half-cycle at {begin:.6g} s has only {size} samples, but {MINIMUM} are needed for velocities; "
            "sample faster."
        )
    block = max(1, size // DENSE)
    kept = first + size // block * block
    times, positions = (values[first:kept].reshape(-1, block).mean(axis=1) for values in (t, x))
    return Stroke(times, positions, step * block, noise / block**0.5, direction, float(begin), float(end))


def _point_std(times: np.ndarray, points: np.ndarray, noise: float, step: float, resting: float) -> np.ndarray:
    """Standard uncertainty of the points: of reversals by their windows, of a stop by `resting` samples behind it."""
    durations, sizes = np.diff(times), np.abs(np.diff(points))
    before, after = np.append(sizes[0], sizes), np.append(sizes, sizes[-1])
    width = window(np.append(durations, durations[-1]), np.maximum(before, after) / 2, noise, step)
    std = point_std(width, order_for(np.minimum(before, after), noise), noise, step)
    if resting:
        std[-1] = noise / np.sqrt(resting)
    return std
