"""Text tables of numbers, separated by commas, tabs, semicolons or blanks."""

import contextlib
import dataclasses
import functools
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ...errors import DataError, brief
from ..native import TEXT_MARK, restore_text
from ..record import Record
from .assemble import records_of, with_choice
from .choice import Choice
from .dialect import Dialect, Layout, sniff
from .fields import BLANK, MISSING, NUMBER, WATCH, WORD, kind_of, number, seconds_of, split
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
    """
    dialect = Dialect(delimiter, decimal, comment, skip_rows, header)
    text = Text.of(path, encoding)
    if choice.takes_all and dialect == Dialect() and next(text.lines()).startswith(TEXT_MARK):
        restored = restore_text(path, list(text.lines()))
        if restored is not None:
            return with_choice(restored, choice)
    sheet = TextTable.of(text, dialect, path.name).sheet()
    return records_of(path, "csv", sheet, choice, **vars(dialect), encoding=encoding)


# Numbers of lines to detect the layout from. The last is enough for the longest preamble and far more rows than needed.
# A tenth of the lines takes a tenth of the time, and the rows below do not fit a wrong layout.
_LINES = (8, 80, 1000)
_FEW = 4  # tables with at most this many columns are read in one pass, before the selection


@dataclasses.dataclass(frozen=True)
class TextTable:
    """A table of numbers in a text with a known layout."""

    text: Text
    dialect: Dialect
    layout: Layout

    @classmethod
    def of(cls, text: Text, dialect: Dialect, source: str) -> "TextTable":
        """Detect the layout of a text.

        A layout from a few lines is right if every field below is a number.
        """
        for count in _LINES[:-1]:
            with contextlib.suppress(DataError):
                table = cls(text, dialect, sniff(text.first(count), dialect, source))
                values = table._narrow
                if len(values) == len(table.layout.titles) and all(np.isfinite(each).all() for each in values.values()):
                    return table
        return cls(text, dialect, sniff(text.first(_LINES[-1]), dialect, source))

    def sheet(self) -> Sheet:
        """Return the columns of the table.

        If the line of titles is repeated further down, each block of rows is a run.
        """
        layout = self.layout
        columns = [self._column(i) for i in range(len(layout.titles))]
        if not self._is_stacked():
            place = lambda i: f"row {next(itertools.islice(self.rows(), i, None))[0]}"
            return Sheet(columns, self._load, place, layout.rate)
        blocks = self._blocks()
        stacked = [
            dataclasses.replace(column, run=f"Run {i + 1}", key=(i, column.key))
            for i in range(len(blocks))
            for column in columns
        ]
        load = lambda wanted: [self._checked(blocks[run], [i])[i] for run, i in (column.key for column in wanted)]
        return Sheet(stacked, load, rate=layout.rate)

    def rows(self) -> Iterator[tuple[int, str]]:
        """Yield lines of data with their row numbers, counted from 1."""
        for i, line in enumerate(self.text.lines()):
            if i >= self.layout.first_line and self.dialect.holds_data(line):
                yield i + 1, line

    def is_row(self, line: str) -> bool:
        """Return True if a line has a number in a numeric column."""
        fields = split(line, self.layout.delimiter)
        return any(
            kind in (NUMBER, WATCH) and kind_of(field, self.layout.decimal) == kind
            for field, kind in zip(fields, self.layout.kinds, strict=False)
        )

    def _column(self, i: int) -> Column:
        layout = self.layout
        (name, unit, run), kind, clock = layout.titles[i], layout.kinds[i], layout.kinds[i] == WATCH
        if unit is None and layout.kinds[i + 1 : i + 2] == [WORD]:
            # The next column may repeat the unit in each row.
            word = split(next(self.rows())[1], layout.delimiter)[i + 1]
            unit = word if is_unit(word) else None
        if clock and not is_time(name, unit):
            unit = "s"
        fault = {WORD: "holds words", BLANK: "is empty"}.get(kind)
        return Column(name, unit, run, layout.texts[i], None, fault, not layout.texts[i], clock, key=i)

    def _load(self, wanted: Sequence[Column]) -> list[np.ndarray]:
        places = [column.key for column in wanted]
        values = self._narrow if set(places) <= set(self._narrow) else self._read_at_once(places)
        # Pandas does not notice rows with too many fields if some columns are skipped.
        partly = set(places) != set(range(len(self.layout.titles)))
        if not values or (partly and self._has_too_long_row(values[places[0]].size)):
            # Comments between the rows, words below them, or an invalid row: read line by line.
            values = self._checked(self._blocks()[0], places)
        return [values[i] for i in places]

    @functools.cached_property
    def _narrow(self) -> dict[int, np.ndarray]:
        """All numbers of a table with few columns.

        It is empty for more columns, or if a row does not fit.
        """
        places = [i for i, kind in enumerate(self.layout.kinds) if kind in (NUMBER, WATCH)]
        return self._read_at_once(places) if len(places) <= _FEW else {}

    def _read_at_once(self, places: Sequence[int]) -> dict[int, np.ndarray]:
        """Read columns in one pass; empty if a row misfits.

        Times of day become seconds.
        """
        import pandas as pd

        layout, text, every = self.layout, self.text, range(len(self.layout.titles))
        clocks = {i for i in places if layout.kinds[i] == WATCH}
        # Pandas refuses names of columns that no row has, such as LabVIEW's comment column without comments.
        wanted = None if set(places) == set(every) else sorted(set(places))
        if any(line.count('"') % 2 for line in text.first(layout.first_line)):
            return {}  # the parser would join the lines after an open quote
        # Without the handling of gaps and blanks, reading takes two thirds of the time.
        for gaps in (False, True):
            # Pandas reads a long text faster from its path, and skips the lines of a short one slower than `open`.
            file, skipped = (text.path, layout.first_line) if text.in_file else (text.open(layout.first_line), 0)
            # Pandas raises many kinds of errors for a cell or a row that does not fit.
            with contextlib.suppress(ValueError, TypeError, OverflowError):
                table = pd.read_csv(
                    file,
                    sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                    decimal=layout.decimal,
                    thousands=layout.thousands,
                    header=None,
                    skiprows=skipped,
                    names=every if wanted is None else range(wanted[-1] + 1),
                    usecols=wanted,
                    # One type for all columns takes less time than one for each.
                    dtype={i: str if i in clocks else np.float64 for i in places} if clocks else np.float64,
                    index_col=False,
                    na_filter=gaps,
                    na_values=list(MISSING) if gaps else None,
                    skipinitialspace=gaps,
                    encoding_errors="replace",
                    low_memory=text.in_file,  # a short text needs no parts
                )
                return {i: seconds_of(table[i]) if i in clocks else table[i].to_numpy(np.float64) for i in places}
        return {}

    def _checked(self, rows: Iterable[tuple[int, str]], places: Sequence[int]) -> dict[int, np.ndarray]:
        """Read columns line by line; refuse the first row that misfits."""
        layout, name = self.layout, self.text.path.name
        cells: list[list[str]] = []
        for row, line in rows:
            fields = split(line, layout.delimiter)
            cells.append([fields[i] if i < len(fields) else "" for i in places])
            for i, cell in zip(places, cells[-1], strict=True):
                if kind_of(cell, layout.decimal) not in (layout.kinds[i], BLANK):
                    raise DataError(
                        f"{name}, row {row}, column '{layout.titles[i].name}': {brief(cell)} is not a number; repair "
                        "the cell or leave it empty."
                    )
            if line.count('"') % 2:
                raise DataError(f"{name}, row {row}: a quote is open; repair the row.")
            if self._is_too_long(fields):
                raise DataError(
                    f"{name}, row {row}: {len(fields)} fields, but {len(layout.titles)} were expected; repair the row, "
                    "or give delimiter= and skip_rows=."
                )
        return {
            i: seconds_of(column)
            if layout.kinds[i] == WATCH
            else np.array([number(cell, layout.decimal) for cell in column], dtype=np.float64)
            for i, column in zip(places, zip(*cells, strict=True), strict=True)
        }

    def _has_too_long_row(self, rows: int) -> bool:
        """Return True if one of the rows has more fields than columns."""
        layout = self.layout
        parts = self.text.parts(layout.first_line)
        marks = sum(part.count(layout.delimiter.encode()) for part in parts) if layout.delimiter != " " else None
        # Splitting each line takes much longer than counting the delimiters.
        return marks != rows * (len(layout.titles) - 1) and any(
            self._is_too_long(split(line, layout.delimiter)) for _, line in self.rows()
        )

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
        if self.layout.title_line is None or self._narrow:
            return False
        title = self.layout.title_line.strip().encode(self.text.encoding.removesuffix("-sig"), "replace")
        return any(title in part for part in self.text.parts(self.layout.first_line))

    def _blocks(self) -> list[list[tuple[int, str]]]:
        """Return the rows below each line of titles.

        Other lines before and after the rows are left out.
        """
        title = (self.layout.title_line or "").strip()
        blocks: list[list[tuple[int, str]]] = [[]]
        for row in self.rows():
            if row[1].strip() == title:
                blocks.append([])
            else:
                blocks[-1].append(row)
        for block in blocks:
            while block and not self.is_row(block[-1][1]):
                block.pop()
        trimmed = (list(itertools.dropwhile(lambda row: not self.is_row(row[1]), block)) for block in blocks)
        return [block for block in trimmed if block]
