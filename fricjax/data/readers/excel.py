"""Excel worksheets, read as tab-separated text; several worksheets are several runs."""

import dataclasses
import datetime
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..files import library
from ..record import Record
from .assemble import records_of
from .choice import Choice
from .csv import TextTable
from .dialect import Dialect, sniff
from .sheet import Column, Sheet
from .text import HEAD, Text

# Size limit of an unpacked workbook [bytes]. A million rows, Excel's own limit, of ten numbers need about 400 MB.
_LARGEST = 1 << 29
# A worksheet with fewer rows of numbers holds settings or remarks.
_FEWEST = 10


def read_excel(
    path: Path,
    choice: Choice,
    *,
    skip_rows: int | None = None,
    header: bool | None = None,
) -> Record | list[Record]:
    """Read a worksheet of an `.xlsx` file, with stored formula values.

    Options as for text; `run` is the name or number of a worksheet if several hold numbers.

    Raises:
        DataError: a damaged file, or no worksheet with a table of numbers.
        UsageError: the package openpyxl is not installed.
    """
    dialect = Dialect("tab", ".", comment="\0", skip_rows=skip_rows, header=header)
    tables: dict[str, TextTable] = {}
    trouble: DataError | None = None
    for title, text in _worksheets(path).items():
        try:
            table = TextTable(text, dialect, sniff(text.head, dialect, f"{path.name}, sheet '{title}'"))
            if table.has_rows(_FEWEST):
                tables[title] = table
        except DataError as error:
            trouble = error
    if not tables:
        raise trouble or DataError(f"{path.name} holds no worksheet with rows.")
    sheet = _joined({title: table.sheet() for title, table in tables.items()})
    return records_of(path, "xlsx", sheet, choice, skip_rows=skip_rows, header=header)


def _joined(sheets: dict[str, Sheet]) -> Sheet:
    """Join the worksheets to one sheet; each of several is a run."""
    if len(sheets) == 1:
        return next(iter(sheets.values()))
    columns = [
        dataclasses.replace(column, run=f"{title}, {column.run}" if column.run else title, key=(title, column))
        for title, sheet in sheets.items()
        for column in sheet.columns
    ]

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [sheets[title].load([column])[0] for title, column in (each.key for each in wanted)]

    return Sheet(columns, load)


def _worksheets(path: Path) -> dict[str, Text]:
    """Return the worksheets with rows, as texts."""
    openpyxl = library(path, "openpyxl", "excel")
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(part.file_size for part in archive.infolist())
        if size > _LARGEST:
            raise DataError(
                f"{path.name} unpacks to {size >> 20} MB, more than {_LARGEST >> 20} MB; export it as .csv."
            )
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        rows = {sheet.title: sheet.iter_rows(values_only=True) for sheet in book.worksheets}
        texts = {
            title: "\n".join("\t".join(map(_cell, row)) for row in lines).encode() for title, lines in rows.items()
        }
        book.close()
    except DataError:
        raise
    except Exception as error:  # openpyxl passes on the exceptions of its zip and XML parsers
        raise DataError(f"{path.name} cannot be read as .xlsx; it is damaged or of another format.") from error
    return {title: Text.cut(path, "utf-8", text[:HEAD], text) for title, text in texts.items() if text.strip()}


def _cell(value: Any) -> str:
    """Return a cell as a field of text."""
    if value is None:
        return ""
    if isinstance(value, datetime.datetime | datetime.time):
        return value.isoformat(" ") if isinstance(value, datetime.datetime) else value.isoformat()
    return " ".join(str(value).split())
