"""The runs that a function works on, whatever they come as: records, paths, tables, arrays, one or several."""

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
    """What a run is read from, and the options of `fricjax.read` for it."""

    run: Any
    options: dict[str, Any]


def gather(data: Any, t: Any = None, rate: float | None = None) -> tuple[Record, ...]:
    """The records of one run or of several.

    Args:
        data: a run as `fricjax.read` takes it, or a list of such; a record is taken as it is.
        t: times of displacements that come without, those of all runs or a list of one per run.
        rate: samples per second, where there are no times.

    Raises:
        UsageError: an empty list, or something of which no record can be made.
        DataError: a file or table that cannot be read.
    """
    sources = sources_of(data, t, rate)
    if not sources:
        raise UsageError("There is no run: the list is empty.")
    several = len(sources) > 1
    return tuple(record_of(run, f"run {i}: " if several else "", **options) for i, (run, options) in enumerate(sources))


def sources_of(data: Any, t: Any = None, rate: float | None = None) -> list[Source]:
    """The runs one by one: those of a list, a tuple or an iterator; (t, x) and a list of numbers are one run.

    With `t` or `rate`, the rows of an array are runs.

    Raises:
        UsageError: times of another number of runs.
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
    """Whether an object is an array of more than one row."""
    return is_numbers(source) and not hasattr(source, "columns") and np.ndim(source) == 2 and np.shape(source)[0] > 1


def record_of(source: Any, where: str = "", **options: Any) -> Record:
    """The record of one run, read with options; `where` goes before the message of one that is in memory.

    Raises:
        UsageError: something of which no record can be made.
        DataError: a file or table that cannot be read.
    """
    if isinstance(source, Record) and not options:
        return source
    is_file = isinstance(source, str | os.PathLike)
    try:
        return read(source, **options)
    except (DataError, UsageError) as error:
        asks = not options and not is_pair(source) and _OPTION.search(str(error)) and "fricjax." not in str(error)
        # Options belong to read: who fits a file or a table at once is told where to write them.
        what = repr(str(source)) if is_file else "table"
        hint = f"Read it first: fricjax.read({what}, ...)." if asks else ""
        first, *rows = str(error).split("\n")
        message = "\n".join([" ".join(filter(None, [first, hint])), *rows])
        # The readers' own kinds of refusal are made of other things than a sentence.
        kind = DataError if isinstance(error, DataError) else UsageError
        raise kind(f"{'' if is_file else where}{message}") from error
