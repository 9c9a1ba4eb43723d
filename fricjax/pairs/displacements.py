"""Pairs of initial and final displacement, from records or from the user.

The initial displacement must be the one from which the free motion starts. If a magnet releases slowly, or a hand
releases the mass, the displacement before the release is biased. The first reversal is free of this bias and is an
equally good start: the first reversal and the rest position are a pair with one half-cycle less.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data.gather import gather
from ..data.record import Record, check_displacement, labels
from ..data.segmentation.decay import Segmentation
from ..data.segmentation.reversals import order_for, point_std, window
from ..data.table import read_table
from ..errors import DataError, UsageError
from ..fitting.settings import check_start
from ..numbers import real


class Pairs(NamedTuple):
    """Pairs of displacements as read from the instrument.

    Attributes:
        x0, xf: initial and final displacement [m], shape (pairs,).
        half_cycles: number of half-cycles between them, shape (pairs,); None if unknown.
        sigma: standard deviation of each final displacement [m], including that of the initial one, shape (pairs,); or
            None.

    Examples:
        >>> import numpy as np
        >>> Pairs(np.array([2e-3]), np.array([-5e-5]), np.array([5]), None).half_cycles
        array([5])
    """

    x0: np.ndarray
    xf: np.ndarray
    half_cycles: np.ndarray | None
    sigma: np.ndarray | None


def pairs_of(records: Any, *, start: str = "first_reversal") -> Pairs:
    """Return displacement pairs and numbers of half-cycles of recorded runs.

    Args:
        records: runs that come to rest, each as for :func:`fricjax.fit`.
        start: "first_reversal", which the release cannot bias, or "release": the displacement before the release, or
            the first sample of a trace that begins with the motion.

    Raises:
        UsageError: no records, or an unknown start.
        DataError: a run that does not come to rest, or has no reversal as a start.

    Examples:
        >>> from fricjax.data import example_paths
        >>> pairs = pairs_of(example_paths().run)
        >>> pairs.half_cycles, pairs.x0.round(6), pairs.xf.round(6)
        (array([12]), array([-0.001797]), array([9.3e-05]))
    """
    check_start(start, "first_reversal or release")
    runs = gather(records)
    rows = []
    for run, label in zip(runs, labels([run.name for run in runs]), strict=True):
        check_displacement(run, "a pair of displacements")
        segmentation, amplitude = run.segmentation, run.segmentation.amplitude
        if segmentation.rest is None or segmentation.rest_position is None:
            raise DataError(
                f"There is no final displacement of {label}, which does not come to rest within its record."
            )
        of_rest = _of_mean(segmentation, run, run.t >= segmentation.rest)
        if start == "release":
            before = run.t <= segmentation.release
            x0, of_start = float(np.mean(run.x[run.mask & before])), _of_mean(segmentation, run, before)
            half_cycles = segmentation.n_half_cycles
        elif segmentation.turning_points.size:
            x0, of_start = float(segmentation.turning_points[0]), _of_reversal(segmentation, run)
            half_cycles = segmentation.n_half_cycles_after_first_reversal
        else:
            raise DataError(f"There is no reversal in {label} before its rest; take its pair from the release.")
        # Each half-cycle passes on an error of the start, reduced slightly by damping. The floor keeps the errors of
        # exact synthetic runs positive.
        sigma = max(float(np.hypot(of_rest, of_start)), 1e-12 * amplitude)
        rows.append((x0, segmentation.rest_position, half_cycles, sigma))
    x0, xf, counts, sigma = (np.array(column) for column in zip(*rows, strict=True))
    return Pairs(x0, xf, counts.astype(int), sigma)


def _of_mean(segmentation: Segmentation, run: Record, inside: np.ndarray) -> float:
    """Return the standard error of a mean over samples [m].

    The correlation time of the slow noise is one half-cycle.
    """
    samples = max(int(np.sum(run.mask & inside)), 1)
    independent = max(samples / (run.rate * segmentation.half_period), 1.0)
    return float(np.hypot(segmentation.white_noise / samples**0.5, _slow(segmentation) / independent**0.5))


def _of_reversal(segmentation: Segmentation, run: Record) -> float:
    """Return the standard error of the position of the first reversal [m].

    Slow noise does not average out over its window.
    """
    noise, step = segmentation.white_noise, 1 / run.rate
    swing = abs(float(segmentation.turning_points[0]))
    width = window(segmentation.half_period, swing, segmentation.noise, step)
    return float(np.hypot(point_std(width, order_for(swing, segmentation.noise), noise, step), _slow(segmentation)))


def _slow(segmentation: Segmentation) -> float:
    """Return the noise that is not white [m]."""
    return max(segmentation.noise**2 - segmentation.white_noise**2, 0.0) ** 0.5


def checked_pairs(x0: Any, xf: Any, half_cycles: Any, sigma: Any) -> Pairs:
    """Check pairs and return them as arrays of equal length.

    Raises:
        UsageError: arrays of different lengths, or invalid numbers.
        DataError: values that are not finite.
    """
    initial, final = (
        np.atleast_1d(real(name, each, "a list of displacements")) for name, each in (("x0", x0), ("xf", xf))
    )
    if initial.ndim != 1 or initial.shape != final.shape:
        raise UsageError(f"x0 and xf must be lists of equal length, got shapes {initial.shape} and {final.shape}.")
    for name, values in (("x0", initial), ("xf", final)):
        lost = np.flatnonzero(~np.isfinite(values))
        if lost.size:
            raise DataError(
                f"{name}[{lost[0]}] is {values[lost[0]]}: {lost.size} pair(s) are not finite. Leave them out."
            )
    if half_cycles is not None:
        half_cycles = np.atleast_1d(np.asarray(half_cycles))
        if half_cycles.shape != initial.shape:
            raise UsageError(
                f"half_cycles must be one number per pair ({initial.size}), got shape {half_cycles.shape}."
            )
        wrong = np.flatnonzero((half_cycles < 0) | (half_cycles != np.round(half_cycles)))
        if wrong.size:
            raise UsageError(
                f"half_cycles[{wrong[0]}] is {half_cycles[wrong[0]]}: it must be a whole number, zero or more."
            )
        half_cycles = half_cycles.astype(int)
    if sigma is not None:
        stds = np.asarray(sigma, float)
        if stds.shape not in ((), initial.shape) or not np.all(stds > 0) or not np.all(np.isfinite(stds)):
            raise UsageError(
                f"sigma must be a positive number of metres, or one per pair ({initial.size}), got {sigma!r}."
            )
        sigma = np.broadcast_to(stds, initial.shape).copy()
    return Pairs(initial, final, half_cycles, sigma)


def read_pairs(path: str | Path) -> Pairs:
    r"""Read pairs from a text table.

    Its first two columns must be the initial and final displacement.

    Args:
        path: the file; delimiter and header are detected. Units in the header, as in ``x0 [um]``, are used; the default
            is metres.

    Raises:
        DataError: no such file, no such table, a row that is not numeric, or a unit that does not fit.

    Examples:
        >>> import pathlib, tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table = pathlib.Path(folder, "pairs.csv")
        ...     _ = table.write_text("x0 [um],xf [um]\n2000,75\n1500,-30\n")
        ...     read_pairs(table).xf
        array([ 7.5e-05, -3.0e-05])
    """
    table = read_table(path, {"x0": "m", "xf": "m"}, what="a table of pairs")
    return Pairs(table["x0"], table["xf"], None, None)
