"""The half-cycles of a record: the samples between neighbouring reversals.

Friction jumps at each reversal, and the holding magnet may still pull before the first one. Evaluations by energy or
force therefore use the half-cycles after the first reversal, each separately. Losses other than friction (damping and
drag) come from the rig, or from a free decay without contact.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ..data import Record
from ..data.gather import gather
from ..data.record import check_displacement, labels
from ..data.segmentation.reversals import order_for, point_std, window
from ..errors import DataError, UsageError
from ..fitting import fit
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..rig import Rig

# Largest relative deviation of a sampling interval from the mean. Local polynomials assume even sampling.
EVEN = 1e-3
# Samples per half-cycle above which blocks are averaged. This keeps the information on friction and bounds the cost of
# the windows, which grow with the sample rate.
DENSE = 2000
# Fewest samples in a half-cycle: two windows of a local polynomial.
MINIMUM = 16


@dataclasses.dataclass(frozen=True, eq=False)
class HalfCycle:
    """The motion from one reversal to the next.

    Attributes:
        t: times of its samples [s], shape (n,), all between the two reversals.
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
    """The half-cycles of a record after its first reversal.

    Attributes:
        half_cycles: the half-cycles; the last one may end in the stop.
        times, points: reversals and stop: times [s] and positions [m], shape (r,).
        point_std: standard uncertainty of `points` from the noise [m], shape (r,).
    """

    half_cycles: tuple[HalfCycle, ...]
    times: np.ndarray
    points: np.ndarray
    point_std: np.ndarray


def each_of[T](records: Any, evaluate: Callable[[Any], T]) -> tuple[list[T], tuple[str, ...]]:
    """Evaluate one or several records; skip unusable ones among several.

    Args:
        records: a run, or a list of runs, each as for :func:`fricjax.fit`.
        evaluate: function of a record; raises a `DataError` for an unusable one.

    Returns:
        The results, and a sentence for each skipped record.

    Raises:
        UsageError: an empty list, or an object of an unsupported type.
        DataError: a single record is unusable, or all of several.
    """
    runs = gather(records)
    if len(runs) == 1:
        return [evaluate(runs[0])], ()
    results, notes = [], []
    for label, run in zip(labels([run.name for run in runs]), runs, strict=True):
        try:
            results.append(evaluate(run))
        except DataError as error:
            notes.append(f"Left out {label}: {error}")
    if not results:
        raise DataError(f"None of the {len(runs)} records can be used. {notes[0]}")
    return results, tuple(notes)


def decay(record: Record, least: int = 2) -> Decay:
    """Split a record into half-cycles after its first reversal.

    Raises:
        DataError: uneven sampling, no reversal, or fewer than `least` half-cycles after the first reversal.
    """
    check_displacement(record, "the loss of energy")
    t, x, segmentation = np.asarray(record.t, float), np.asarray(record.x, float), record.segmentation
    step = _even_step(t, record.mask)
    times, points, rest = segmentation.turning_times, segmentation.turning_points, segmentation.rest
    if not times.size:
        raise DataError(
            "The motion never turns round, so that there is no half-cycle between two reversals; release the mass "
            "from farther away."
        )
    if rest is not None and segmentation.rest_position is not None:
        times, points = np.append(times, rest), np.append(points, segmentation.rest_position)
    if times.size <= least:
        raise DataError(
            f"Half-cycles after the first reversal: {times.size - 1}. At least {least} are needed, because one in "
            "each direction separates friction from the equilibrium; release the mass from farther away."
        )
    # The stated noise, else that of the record; never zero, so that exact motions have finite weights.
    stated = segmentation.noise if record.sigma is None else float(np.median(record.sigma))
    noise = max(stated, 1e-12 * segmentation.amplitude)
    directions, durations, sizes = np.sign(np.diff(points)).astype(int), np.diff(times), np.abs(np.diff(points))
    ends = zip(times[:-1], times[1:], directions, strict=True)
    half_cycles = tuple(_half_cycle(t, x, step, noise, *end) for end in ends)
    # The uncertainty of a reversal follows from the window in which the segmentation fitted it.
    before, after = np.append(sizes[0], sizes), np.append(sizes, sizes[-1])
    width = window(np.append(durations, durations[-1]), np.maximum(before, after) / 2, noise, step)
    std = point_std(width, order_for(np.minimum(before, after), noise), noise, step)
    if rest is not None:
        # A stop is the mean of the samples at rest.
        std[-1] = noise / np.sqrt(max((t[-1] - rest) / step, 1.0))
    return Decay(half_cycles, times, points, std)


def _even_step(t: np.ndarray, mask: np.ndarray) -> float:
    """Return the sampling interval [s].

    Raises:
        DataError: uneven intervals, or masked samples.
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


def _half_cycle(
    t: np.ndarray, x: np.ndarray, step: float, noise: float, begin: float, end: float, direction: int
) -> HalfCycle:
    """Return the samples between two reversals, in averages if dense."""
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
    return HalfCycle(times, positions, step * block, noise / block**0.5, direction, float(begin), float(end))


def frictionless(rig: Rig, *, damping_known: bool = True) -> Oscillator:
    """Return the oscillator of a rig without friction.

    It has mass, restoring force, damping and drag.

    Args:
        rig: the rig.
        damping_known: True if the rig must state its damping.

    Raises:
        UsageError: not a rig, or a rig without damping although the viscous loss must be separated from friction.
    """
    if not isinstance(rig, Rig):
        raise UsageError(f"rig must be a fricjax.Rig, got {type(rig).__name__}. Read one with Rig.from_toml(path).")
    if damping_known and rig.damping is None and rig.damping_ratio is None:
        raise UsageError(
            "The rig has no damping, so that its viscous loss would count as friction. Give the rig its damping "
            "or damping_ratio (0 for none), or a no-contact run."
        )
    return rig.oscillator(Coulomb(0.0))


def with_losses(rig: Rig, no_contact: Any = None) -> Rig:
    """Return the rig with damping and drag from a run without contact.

    Args:
        rig: mass, restoring force and load; without a `no_contact` run also damping and drag.
        no_contact: a free decay without contact, as for :func:`fricjax.fit`, which gives damping and drag. The load may
            change the stiffness of the springs, so its stiffness is fitted too but not used. None: return `rig`.

    Raises:
        UsageError: not a rig, a rig without damping and no run, or a `no_contact` of an unsupported type.
        DataError: a run without contact that cannot be read.
        FitError: a run without contact that cannot be fitted.
    """
    oscillator = frictionless(rig, damping_known=no_contact is None)
    if no_contact is None:
        return rig
    values = fit(no_contact, oscillator, ["damping", "drag", "stiffness"]).values
    return rig.replace(damping=values["damping"], drag=values["drag"])
