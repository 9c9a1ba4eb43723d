"""Text tables of numbers, separated by commas, tabs, semicolons or blanks."""

import dataclasses
import functools
import io
import itertools
import mmap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import DataError, brief
from ..native import TEXT_MARK, restore_text
from ..record import Record
from .assemble import records_of, with_choice
from .choice import Choice
from .dialect import Dialect, Layout, sniff
from .fields import BLANK, MISSING, NUMBER, WATCH, WORD, kind_of, seconds_of, split
from .header import is_time, is_unit
from .sheet import Column, Sheet
from .text import Text


def read_csv(
    path: Path,
    choice: Choice,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    comment: str | None = None,
    skip_rows: int | None = None,
    header: bool | None = None,
    encoding: str | None = None,
) -> Record | list[Record]:
    """Read a text table; missing options are detected from the file.

    Options as in `fricjax.read` (columns by title or by index from 0), and

    - `delimiter`: field separator: a character, or "tab", "space", "comma", "semicolon".
    - `decimal`: "." or ",".
    - `comment`: start of a comment; by default #, %, ! and //.
    - `skip_rows`: rows to skip at the top.
    - `header`: False if the row before the data holds no titles.
    - `encoding`: of the text; by default by byte order mark, else UTF-8, else Latin-1.

    Raises:
        DataError: no table of numbers, an unknown column or run, or a cell that is not a number (with its row).
    """
    dialect = Dialect(delimiter, decimal, comment, skip_rows, header)
    text = Text.of(path, encoding)
    if choice.takes_all and dialect == Dialect() and text.head[0].startswith(TEXT_MARK):
        restored = restore_text(path, list(text.lines()))
        if restored is not None:
            return with_choice(restored, choice)
    table = TextTable(text, dialect, sniff(text.head, dialect, path.name))
    return records_of(path, "csv", table.sheet(), choice, **vars(dialect), encoding=encoding)


_FEW = 4  # tables with at most this many columns are read in one pass, before the selection
# Exceptions of pandas for cells and rows that do not fit.
_UNREADABLE = (ValueError, TypeError, OverflowError)


@dataclasses.dataclass(frozen=True)
class TextTable:
    """A table of numbers in a text file with a known layout."""

    text: Text
    dialect: Dialect
    layout: Layout

    def sheet(self) -> Sheet:
        """Return the columns of the table.

        If the line of titles is repeated further down, each block of rows is a run.
        """
        layout = self.layout
        columns = [self._column(i) for i in range(len(layout.titles))]
        if not self._is_stacked():
            place = lambda i: f"row {next(itertools.islice(self._numbered_lines(), i, None))[0]}"
            return Sheet(columns, self._load, place, layout.rate)
        blocks = self._blocks()
        runs = range(len(blocks))
        stacked = [dataclasses.replace(c, run=f"Run {i + 1}", key=(c.key, i)) for i in runs for c in columns]

        def load(wanted: Sequence[Column]) -> list[np.ndarray]:
            return [self._parsed_lines(blocks[run], [i])[i] for i, run in (column.key for column in wanted)]

        return Sheet(stacked, load, rate=layout.rate)

    def has_rows(self, count: int) -> bool:
        """Return True if the table has `count` rows of numbers."""
        rows = (line for line in self.text.head[self.layout.first_line :] if self._is_row(line))
        return next(itertools.islice(rows, count - 1, None), None) is not None

    def _column(self, i: int) -> Column:
        layout = self.layout
        title, kind = layout.titles[i], layout.kinds[i]
        unit = title.unit or self._unit_beside(i)
        if kind == WATCH and not is_time(title.name, unit):
            unit = "s"
        fault = {WORD: "holds words", BLANK: "is empty"}.get(kind)
        clock = kind == WATCH
        return Column(title.name, unit, title.run, layout.texts[i], None, fault, not layout.texts[i], clock, key=i)

    def _unit_beside(self, i: int) -> str | None:
        """Return the unit that the next column repeats in each row."""
        if self.layout.kinds[i + 1 : i + 2] != [WORD]:
            return None
        word = split(self.text.head[self.layout.first_line], self.layout.delimiter)[i + 1]
        return word if is_unit(word) else None

    def _load(self, wanted: Sequence[Column]) -> list[np.ndarray]:
        places = [column.key for column in wanted]
        narrow = self._narrow
        values = narrow if set(places) <= set(narrow) else self._read_at_once(places)
        if not values or not self._is_complete(values[places[0]].size, places):
            # Comments between the rows, words below them, or an invalid row: read line by line.
            lines = _trimmed(list(self._numbered_lines()), lambda numbered: self._is_row(numbered[1]))
            self._check(lines, places)
            values = self._parsed_lines([line for _, line in lines], places)
        return [values[i] for i in places]

    @functools.cached_property
    def _narrow(self) -> dict[int, np.ndarray]:
        """All numbers of a table with few columns.

        It is empty for more columns, or if a row does not fit.
        """
        places = [i for i, kind in enumerate(self.layout.kinds) if kind in (NUMBER, WATCH)]
        return self._read_at_once(places) if len(places) <= _FEW else {}

    def _read_at_once(self, places: list[int]) -> dict[int, np.ndarray]:
        """Read the columns in one pass; empty if a row misfits."""
        first, text = self.layout.first_line, self.text
        if any(line.count('"') % 2 for line in text.head[:first]):
            return {}  # the parser would join the lines after an open quote
        # Without the handling of gaps and blanks, reading takes two thirds of the time.
        for gaps in (False, True):
            try:
                # Pandas reads faster from a path than from an open file.
                file = text.path if text.wide is None else io.BytesIO(text.wide)
                return self._parsed(file, places, skiprows=first, na_filter=gaps, skipinitialspace=gaps)
            except _UNREADABLE:
                continue
        return {}

    def _parsed_lines(self, lines: list[str], places: list[int]) -> dict[int, np.ndarray]:
        try:
            return self._parsed(io.BytesIO("\n".join(lines).encode()), places, skipinitialspace=True)
        except _UNREADABLE as error:
            raise DataError(
                f"{self.text.path.name} could not be read as a table: {str(error).strip()[:200]}; give delimiter=, "
                "decimal= and skip_rows=."
            ) from error

    def _parsed(self, file: Path | IO[bytes], places: list[int], **how: Any) -> dict[int, np.ndarray]:
        """Read the columns at `places` as numbers, shape (rows,) each.

        Times of day become seconds.
        """
        import pandas as pd

        layout = self.layout
        clocks = {i for i in places if layout.kinds[i] == WATCH}
        # Pandas refuses names of columns that no row has, such as LabVIEW's comment column without comments.
        wanted = sorted(set(places)) if self._is_partly(places) else None
        table = pd.read_csv(
            file,
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            thousands=layout.thousands,
            header=None,
            names=range(wanted[-1] + 1 if wanted else len(layout.titles)),
            usecols=wanted,
            dtype={i: str if i in clocks else np.float64 for i in places},
            index_col=False,
            na_values=list(MISSING),
            encoding_errors="replace",
            **how,
        )
        return {i: seconds_of(table[i]) if i in clocks else table[i].to_numpy(dtype=np.float64) for i in places}

    def _is_partly(self, places: list[int]) -> bool:
        """Return True if some columns are skipped.

        Pandas then does not notice rows with too many fields.
        """
        return set(places) != set(range(len(self.layout.titles)))

    def _is_complete(self, rows: int, places: list[int]) -> bool:
        """Return True if no row has more fields than columns."""
        layout, most = self.layout, len(self.layout.titles) - 1
        if not self._is_partly(places):
            return True
        if layout.delimiter != " ":
            mark = layout.delimiter.encode()
            with self.text.open() as file:
                file.seek(self.text.starts[layout.first_line])
                marks = sum(block.count(mark) for block in iter(lambda: file.read(1 << 22), b""))
            if marks == rows * most:
                return True
        return not any(self._is_too_long(split(line, layout.delimiter)) for _, line in self._numbered_lines())

    def _is_too_long(self, fields: list[str]) -> bool:
        """Return True if a row has fields that belong to no column.

        A comment at the end of a row may contain delimiters.
        """
        beyond = fields[len(self.layout.titles) :]
        comment = self.layout.kinds[-1] in (WORD, BLANK)
        return any(field.strip() for field in beyond) and not (
            comment and all(kind_of(field, ".") != NUMBER for field in beyond)
        )

    def _is_stacked(self) -> bool:
        """Return True if the line of titles is repeated below the data."""
        layout, text = self.layout, self.text
        if layout.title_line is None or self._narrow:
            return False
        title = layout.title_line.strip().encode(text.encoding.removesuffix("-sig"), "replace")
        if text.wide is not None:
            return text.wide.find(title, text.starts[layout.first_line]) >= 0
        with text.path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return data.find(title, text.starts[layout.first_line]) >= 0

    def _blocks(self) -> list[list[str]]:
        """Return the rows below each line of titles.

        Other lines before and after the rows are left out.
        """
        title = (self.layout.title_line or "").strip()
        blocks: list[list[str]] = [[]]
        for _, line in self._numbered_lines():
            if line.strip() == title:
                blocks.append([])
            else:
                blocks[-1].append(line)
        return [trimmed for block in blocks if (trimmed := _trimmed(block, self._is_row))]

    def _is_row(self, line: str) -> bool:
        """Return True if a line has a number in a numeric column."""
        fields = split(line, self.layout.delimiter)
        core = [i for i, kind in enumerate(self.layout.kinds) if kind in (NUMBER, WATCH)]
        return any(i < len(fields) and kind_of(fields[i], self.layout.decimal) == self.layout.kinds[i] for i in core)

    def _numbered_lines(self) -> Iterator[tuple[int, str]]:
        """Yield lines of data with their row numbers, counted from 1."""
        for i, line in enumerate(self.text.lines()):
            if i >= self.layout.first_line and self.dialect.holds_data(line):
                yield i + 1, line

    def _check(self, lines: list[tuple[int, str]], places: list[int]) -> None:
        """Refuse the first row that does not fit."""
        layout, name = self.layout, self.text.path.name
        for row, line in lines:
            fields = split(line, layout.delimiter)
            for i in places:
                if i < len(fields) and kind_of(fields[i], layout.decimal) not in (layout.kinds[i], BLANK):
                    raise DataError(
                        f"{name}, row {row}, column '{layout.names[i]}': {brief(fields[i])} is not a number; repair "
                        "the cell or leave it empty."
                    )
            if self._is_too_long(fields):
                raise DataError(
                    f"{name}, row {row}: {len(fields)} fields, but {len(layout.titles)} were expected; repair the row, "
                    "or give delimiter= and skip_rows=."
                )


def _trimmed[T](items: list[T], holds: Callable[[T], bool]) -> list[T]:
    """Remove the items at either end for which `holds` is False."""
    kept = [i for i, item in enumerate(items) if holds(item)]
    return items[kept[0] : kept[-1] + 1] if kept else []
