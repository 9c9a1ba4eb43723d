"""The runs that a function works on, whatever they are given as: records, paths, tables, arrays, one or several."""

import os
import re
from collections.abc import Iterator
from typing import Any

from .errors import DataError, UsageError
from .memory import is_numbers, is_pair
from .read import read
from .record import Record

_OPTION = re.compile(r"\b(column|time|unit|time_unit|rate|delimiter|skip_rows|decimal|run)=")


def gather(data: Any) -> tuple[Record, ...]:
    """The records of one run or of several.

    Args:
        data: a run as `fricjax.read` takes it without options, or a list of such; a record is taken as it is.

    Raises:
        UsageError: an empty list, or something of which no record can be made.
        DataError: a file or table that cannot be read.
    """
    sources = listed(data)
    if not sources:
        raise UsageError("There is no run: the list is empty.")
    return tuple(record_of(source, f"run {i}: " if len(sources) > 1 else "") for i, source in enumerate(sources))


def listed(data: Any) -> list[Any]:
    """The runs one by one: those of a list, a tuple or an iterator; (t, x) and a list of numbers are one run."""
    several = isinstance(data, Iterator) or (isinstance(data, list | tuple) and not (is_pair(data) or is_numbers(data)))
    return list(data) if several else [data]


def record_of(source: Any, where: str = "") -> Record:
    """The record of one run; `where` goes before the message of one that is in memory.

    Raises:
        UsageError: something of which no record can be made.
        DataError: a file or table that cannot be read.
    """
    if isinstance(source, Record):
        return source
    is_file = isinstance(source, str | os.PathLike)
    try:
        return read(source)
    except (DataError, UsageError) as error:
        what = repr(str(source)) if is_file else "..."
        asks = _OPTION.search(str(error)) and "fricjax.read(" not in str(error)
        hint = f" Read it first: fricjax.read({what}, ...)." if asks else ""
        raise type(error)(f"{'' if is_file else where}{error}{hint}") from error
