"""Pairs of initial and final displacement: taken from records, and checked.

The initial displacement that counts is the one that the free motion starts from. A magnet that lets go slowly, or a
hand, makes the held displacement a bad measure of it; the first reversal is free of that, and as good a start as the
release: ``a_1`` and the rest position are a pair with one half-cycle less.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data import Record
from ..data.gather import gather
from ..data.record import labels
from ..data.table import read_table
from ..errors import DataError, UsageError
from ..fitting.settings import check_start


class Pairs(NamedTuple):
    """Pairs of displacements in the reading of the instrument.

    Attributes:
        x0, xf: initial and final displacement [m], shape (pairs,).
        half_cycles: number of half-cycles between them, shape (pairs,), or None where it is not known.
        sigma: standard deviation of each final displacement [m], shape (pairs,), or None.
    """

    x0: np.ndarray
    xf: np.ndarray
    half_cycles: np.ndarray | None
    sigma: np.ndarray | None


def pairs_of(records: Any, *, start: str = "first_reversal") -> Pairs:
    """Initial and final displacements of recorded runs, with their numbers of half-cycles.

    Args:
        records: runs that come to rest, each given as to :func:`fricjax.fit`.
        start: "first_reversal", which no release can bias, or "release": the held displacement, or the first sample of
            a trace that begins with the motion.

    Raises:
        UsageError: no records, or an unknown start.
        DataError: a run that does not come to rest, or has no reversal to start from.

    ```python
    pairs = fricjax.pairs_of(["run1.csv", "run2.csv"])
    ```
    """
    check_start(start, "first_reversal or release")
    runs = gather(records)
    rows = [_pair(run, start, label) for run, label in zip(runs, labels([run.name for run in runs]), strict=True)]
    x0, xf, count, sigma = (np.array(column) for column in zip(*rows, strict=True))
    return Pairs(x0, xf, count.astype(int), sigma)


def _pair(record: Record, start: str, label: str) -> tuple[float, float, int, float]:
    t, x, mask, found = record.t, record.x, record.mask, record.segmentation
    if found.rest is None or found.rest_position is None:
        raise DataError(f"There is no final displacement of {label}, which does not come to rest within its record.")
    resting = max(int(np.sum(mask & (t >= found.rest))), 1)
    noise = max(found.noise, 1e-12 * found.amplitude) / np.sqrt(resting)
    if start == "first_reversal":
        if not found.turning_points.size:
            raise DataError(f"There is no reversal in {label} before its rest; take its pair from the release.")
        return float(found.turning_points[0]), found.rest_position, found.n_half_cycles_after_first_reversal, noise
    held = mask & (t <= found.release)
    return float(np.mean(x[held])), found.rest_position, found.n_half_cycles, noise


def checked_pairs(x0: Any, xf: Any, half_cycles: Any, sigma: Any) -> Pairs:
    """Pairs as arrays of equal length.

    Raises:
        UsageError: arrays that do not fit each other, or numbers that cannot be.
        DataError: values that are not finite.
    """
    start, end = (np.atleast_1d(np.asarray(values, float)) for values in (x0, xf))
    if start.ndim != 1 or start.shape != end.shape:
        raise UsageError(f"x0 and xf must be lists of equal length, got shapes {start.shape} and {end.shape}.")
    for name, values in (("x0", start), ("xf", end)):
        lost = np.flatnonzero(~np.isfinite(values))
        if lost.size:
            raise DataError(
                f"{name}[{lost[0]}] is {values[lost[0]]}: {lost.size} pair(s) are not finite. Leave them out."
            )
    return Pairs(start, end, _checked_counts(half_cycles, start.size), _checked_sigma(sigma, start.size))


def _checked_counts(half_cycles: Any, pairs: int) -> np.ndarray | None:
    if half_cycles is None:
        return None
    counts = np.atleast_1d(np.asarray(half_cycles))
    if counts.shape != (pairs,):
        raise UsageError(f"half_cycles must be one number per pair ({pairs}), got shape {counts.shape}.")
    wrong = np.flatnonzero((counts < 0) | (counts != np.round(counts)))
    if wrong.size:
        raise UsageError(f"half_cycles[{wrong[0]}] is {counts[wrong[0]]}: it must be a whole number, zero or more.")
    return counts.astype(int)


def _checked_sigma(sigma: Any, pairs: int) -> np.ndarray | None:
    if sigma is None:
        return None
    given = np.asarray(sigma, float)
    if given.shape not in ((), (pairs,)) or not np.all(given > 0) or not np.all(np.isfinite(given)):
        raise UsageError(f"sigma must be a positive number of metres, or one per pair ({pairs}), got {sigma!r}.")
    return np.broadcast_to(given, (pairs,)).copy()


def read_pairs(path: str | Path) -> Pairs:
    """Pairs from a text table whose first two columns are initial and final displacement.

    Args:
        path: the file; delimiter and header are found, and units stand in the header as in ``x0 [um]``, else metres.

    Raises:
        DataError: no such file, no such table, a row that is no number, or a unit that does not fit.
    """
    table = read_table(path, {"x0": "m", "xf": "m"}, what="a table of pairs")
    return Pairs(table["x0"], table["xf"], None, None)
