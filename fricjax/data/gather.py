"""Convert user input (records, paths, tables, arrays; one or several) to records."""

import os
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..errors import DataError, UsageError
from .read import read
from .readers.memory import is_numbers, is_pair
from .record import Record

_OPTION = re.compile(r"\b(column|time|unit|time_unit|rate|delimiter|skip_rows|decimal|run)=")


class Source(NamedTuple):
    """A source of a run, with the options of `fricjax.read` for it."""

    run: Any
    options: dict[str, Any]


def gather(data: Any, t: Any = None, rate: float | None = None) -> tuple[Record, ...]:
    """Return the records of one or several runs.

    Args:
        data: a run as `fricjax.read` takes it, or a list of such runs; records are returned unchanged.
        t: times of displacements without times, common to all runs or a list with one entry per run.
        rate: samples per second, if there are no times.

    Raises:
        UsageError: an empty list, or an object of an unsupported type.
        DataError: a file or table that cannot be read.
    """
    sources = sources_of(data, t, rate)
    if not sources:
        raise UsageError("There is no run: the list is empty.")
    several = len(sources) > 1
    return tuple(record_of(run, f"run {i}: " if several else "", **options) for i, (run, options) in enumerate(sources))


def sources_of(data: Any, t: Any = None, rate: float | None = None) -> list[Source]:
    """Split the input into runs.

    Each entry of a list, a tuple or an iterator is a run. A tuple (t, x) and a list of numbers are one run. With `t`
    or `rate`, each row of an array is a run.

    Raises:
        UsageError: the number of times differs from the number of runs.
    """
    bare = t is not None or rate is not None
    several = isinstance(data, Iterator) or (isinstance(data, list | tuple) and not (is_pair(data) or is_numbers(data)))
    if isinstance(data, list) and len(data) == 2 and not bare and all(is_numbers(each) for each in data):
        raise UsageError(
            "A list is several runs, and each of them needs its times. Write a tuple (t, x) for the times and the "
            "displacements of one run; several are given as [(t1, x1), (t2, x2)], or with rate=."
        )
    runs = list(data) if several or (bare and _has_rows(data)) else [data]
    of_each: Any = t if _has_rows(t) or (isinstance(t, list | tuple) and not is_numbers(t)) else [t] * len(runs)
    times = list(of_each)
    if len(times) != len(runs):
        raise UsageError(f"t= holds the times of {len(times)} runs, but there are {len(runs)}.")
    common = {} if rate is None else {"rate": rate}
    options = [common if t is None else {**common, "t": of_run} for of_run in times]
    return [Source(run, of_run) for run, of_run in zip(runs, options, strict=True)]


def _has_rows(source: Any) -> bool:
    """Return True for an array of more than one row."""
    return is_numbers(source) and not hasattr(source, "columns") and np.ndim(source) == 2 and np.shape(source)[0] > 1


def record_of(source: Any, where: str = "", **options: Any) -> Record:
    """Read the record of one run.

    Error messages about in-memory sources begin with `where`.

    Raises:
        UsageError: an object of an unsupported type.
        DataError: a file or table that cannot be read.
    """
    if isinstance(source, Record) and not options:
        return source
    is_file = isinstance(source, str | os.PathLike)
    try:
        return read(source, **options)
    except (DataError, UsageError) as error:
        asks = not options and not is_pair(source) and _OPTION.search(str(error)) and "fricjax." not in str(error)
        # Functions such as fit take no read options, so show how to pass them to read.
        what = repr(str(source)) if is_file else "table"
        hint = f"Read it first: fricjax.read({what}, ...)." if asks else ""
        first, *rows = str(error).split("\n")
        message = "\n".join([" ".join(filter(None, [first, hint])), *rows])
        # Subclasses of DataError and UsageError may have constructors with other arguments.
        kind = DataError if isinstance(error, DataError) else UsageError
        raise kind(f"{'' if is_file else where}{message}") from error
