"""Tables of numbers as text: comma, tab, semicolon or blank separated, with or without a header."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import Choice, Columns, assemble
from ..choose import displacement_index, locate, time_index
from ..errors import DataError, UsageError
from ..native import restore_text
from ..record import Record
from .dialect import MISSING, Dialect, Layout, number, sniff, split


def read_csv(
    path: Path,
    *,
    column: str | int | None = None,
    time: str | int | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    rate: float | None = None,
    sigma: Any = None,
    sign: int = 1,
    delimiter: str | None = None,
    decimal: str | None = None,
    comment: str | None = None,
    skip_rows: int | None = None,
    header: bool | None = None,
    encoding: str | None = None,
) -> Record:
    """Reads a text table; what is not given about its dialect is found in the file.

    Options as in `fricjax.read` (columns by header name or by index from 0), and

    - `delimiter`: what separates fields: a character, or "tab", "space", "comma", "semicolon".
    - `decimal`: "." or ",".
    - `comment`: what a line of remarks begins with; by default #, %, ! and //.
    - `skip_rows`: rows to leave out at the top.
    - `header`: False where the row before the data holds no names.
    - `encoding`: of the text; by default UTF-8, else Latin-1.

    Raises:
        DataError: no table of numbers, an unknown column, a cell that is no number (with its row).
    """
    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    dialect = Dialect(delimiter, decimal, comment, skip_rows, header)
    options = {**vars(choice), **vars(dialect), "encoding": encoding}
    lines = _text(path, encoding).splitlines()
    own = restore_text(path, lines) if choice.takes_all and dialect == Dialect() else None
    if own is not None:
        return choice.applied(own)
    layout = sniff(lines, dialect, path.name)
    x_index, t_index = _indices(path, layout, choice, lines)
    values = _parse(path, lines, layout, dialect, [i for i in (t_index, x_index) if i is not None])
    columns = Columns(
        x=values[x_index],
        time=None if t_index is None else values[t_index],
        x_name=layout.names[x_index],
        time_name="time" if t_index is None else layout.names[t_index],
        x_unit=layout.units[x_index],
        time_unit=None if t_index is None else layout.units[t_index],
        place=lambda i: f"row {_line_numbers(lines, layout, dialect)[i]}",
    )
    return assemble(path, "csv", columns, choice, options)


def _text(path: Path, encoding: str | None) -> str:
    data = path.read_bytes()
    if encoding is None:
        encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        if encoding != "utf-16" and b"\x00" in data[:65536]:
            raise DataError(f"{path.name} is binary, not text; its suffix {path.suffix} promises a text table.")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        return data.decode("latin-1")
    except LookupError as error:
        raise UsageError(f"'{encoding}' is no known text encoding; give one such as 'utf-8' or 'latin-1'.") from error


def _indices(path: Path, layout: Layout, choice: Choice, lines: list[str]) -> tuple[int, int | None]:
    """Indices of displacement and time; an empty column (a trailing delimiter) is no candidate."""
    names, units = layout.names, layout.units
    x = None if choice.column is None else locate(choice.column, names, path.name, "column")
    if choice.time is not None:
        t = locate(choice.time, names, path.name, "time")
    else:
        t = time_index(names, units)
    first = split(lines[layout.first_line], layout.delimiter)
    filled = [i for i in range(len(names)) if first[i] or names[i] != f"column{i}"]
    if t is None and choice.rate is None:
        others = [i for i in filled if i != x]
        t = others[0] if others and len(filled) > 1 and others[0] < (len(names) if x is None else x) else None
    if x is None:
        x = displacement_index(names, [i for i in filled if i != t] or [0], path.name)
    if x == t and choice.time is None:
        t = None
    return x, None if choice.rate is not None else t


def _parse(path: Path, lines: list[str], layout: Layout, dialect: Dialect, wanted: list[int]) -> dict[int, np.ndarray]:
    import pandas as pd

    body = [line for line in lines[layout.first_line :] if line.strip() and not dialect.is_comment(line)]
    width = len(layout.names)
    if any(len(line.split(None if layout.delimiter == " " else layout.delimiter)) > width for line in body):
        raise _bad_row(path, lines, layout, dialect, wanted, "some rows have too many fields")
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(body)),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=range(width),
            usecols=sorted(set(wanted)),
            index_col=False,
            skipinitialspace=True,
            na_values=list(MISSING),
            low_memory=False,
        )
        return {i: table[i].to_numpy(dtype=np.float64) for i in wanted}
    except (ValueError, TypeError, pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise _bad_row(path, lines, layout, dialect, wanted, error) from error


def _bad_row(
    path: Path, lines: list[str], layout: Layout, dialect: Dialect, wanted: list[int], error: Exception | str
) -> DataError:
    """The first row that does not fit, in words."""
    width = len(layout.names)
    for row in _line_numbers(lines, layout, dialect):
        fields = split(lines[row - 1], layout.delimiter)
        for i in wanted:
            if i < len(fields) and number(fields[i], layout.decimal) is None:
                return DataError(
                    f"{path.name}, row {row}, column '{layout.names[i]}': {fields[i]!r} is not a number; repair "
                    "the cell or leave it empty."
                )
        if len(fields) > width:
            return DataError(
                f"{path.name}, row {row}: {len(fields)} fields, but {width} were expected; repair the row, or give "
                "delimiter= and skip_rows=."
            )
    return DataError(f"{path.name} could not be read as a table: {error}; give delimiter=, decimal= and skip_rows=.")


def _line_numbers(lines: list[str], layout: Layout, dialect: Dialect) -> list[int]:
    """Row in the file, counted from 1, of each sample."""
    body = range(layout.first_line, len(lines))
    return [i + 1 for i in body if lines[i].strip() and not dialect.is_comment(lines[i])]
