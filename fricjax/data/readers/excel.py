"""Excel worksheets, read as tab-separated text; several worksheets are several runs."""

import contextlib
import dataclasses
import datetime
import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import openpyxl

from ...errors import DataError
from .choice import Choice
from .csv import TextTable
from .dialect import Dialect
from .sheet import Sheet
from .text import Text

# A worksheet with fewer rows of numbers holds settings or remarks.
_FEWEST = 10


@contextmanager
def open_sheet(
    path: Path, choice: Choice, *, skip_rows: int | None = None, header: bool | None = None
) -> Iterator[Sheet]:
    """Open an `.xlsx` file, with stored formula values.

    Options as for text. Each of several worksheets with numbers is a run.
    """
    dialect = Dialect("tab", ".", comment="\0", skip_rows=skip_rows, header=header)
    tables: dict[str, TextTable] = {}
    trouble: DataError | None = None
    for title, text in _worksheets(path).items():
        try:
            table = TextTable.of(text, dialect, f"{path.name}, sheet '{title}'")
            rows = (line for _, line in table.rows() if table.is_row(line))
            if len(list(itertools.islice(rows, _FEWEST))) == _FEWEST:
                tables[title] = table
        except DataError as error:
            trouble = error
    if not tables:
        raise trouble or DataError(f"{path.name} holds no worksheet with rows.")
    yield _joined({title: table.sheet() for title, table in tables.items()})


def _joined(sheets: dict[str, Sheet]) -> Sheet:
    """Join the worksheets to one sheet; each of several is a run."""
    if len(sheets) == 1:
        return next(iter(sheets.values()))
    columns = [
        dataclasses.replace(column, run=f"{title}, {column.run}" if column.run else title, key=(title, column))
        for title, sheet in sheets.items()
        for column in sheet.columns
    ]
    load = lambda wanted: [sheets[title].load([column])[0] for title, column in (each.key for each in wanted)]
    return Sheet(columns, load)


def _worksheets(path: Path) -> dict[str, Text]:
    """Return the worksheets with rows, as texts."""
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    with contextlib.closing(book):
        rows = {each.title: each.iter_rows(values_only=True) for each in book.worksheets}
        texts = {
            title: "\n".join("\t".join(map(_cell, row)) for row in lines).encode() for title, lines in rows.items()
        }
    return {title: Text(path, "utf-8", text) for title, text in texts.items() if text.strip()}


def _cell(value: Any) -> str:
    """Return a cell as a field of text."""
    if value is None:
        return ""
    if isinstance(value, datetime.datetime | datetime.time):
        return value.isoformat(" ") if isinstance(value, datetime.datetime) else value.isoformat()
    return " ".join(str(value).split())
