"""Check all rows of a table in one test."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest


def check_rows(check: Callable[..., object], rows: Mapping[Any, Any] | Iterable[Any]) -> None:
    """Call `check` with each row and report all failures.

    The rows of a mapping are its values, and its keys name them in the report. A row that is a tuple is unpacked into
    the arguments of `check`.
    """
    __tracebackhide__ = True
    named = rows.items() if isinstance(rows, Mapping) else ((row, row) for row in rows)
    failures = []
    for name, row in named:
        try:
            check(*row) if isinstance(row, tuple) else check(row)
        except (Exception, pytest.fail.Exception) as error:
            failures.append(f"{name}: {type(error).__name__}: {error}")
    assert not failures, "\n".join([f"{len(failures)} rows fail:", *failures])
