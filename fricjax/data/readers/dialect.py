"""The dialect of a text file: delimiter, decimal mark, start of data.

Instruments and spreadsheets write tables in many ways. Options that the caller does not give are detected from the
lines. The delimiter is the one that splits most lines into rows of numbers of equal length. Columns of words or times
of day may occur between them. The titles are the line of words right above the data; a line of units may follow the
titles.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence

from ...errors import DataError, UsageError, brief
from .fields import BLANK, NUMBER, WATCH, WORD, kind_of, split, thousands_in
from .header import Title
from .titles import numbered, stated_rate, titles_of, with_stated_units

COMMENTS = ("#", "%", "!", "//")
DELIMITERS = ("\t", ";", "|", ",", " ")
NAMED = {"tab": "\t", "\\t": "\t", "space": " ", "whitespace": " ", "comma": ",", "semicolon": ";"}
SNIFFED_LINES = 200  # number of rows for the detection of the layout
WIDEST = 10_000  # largest number of fields in a row


@dataclasses.dataclass(frozen=True)
class Dialect:
    """The format of a text table; options that are None are detected."""

    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    skip_rows: int | None = None
    header: bool | None = None

    def __post_init__(self) -> None:
        if self.decimal not in (None, ".", ","):
            raise UsageError(f"decimal must be '.' or ',', but it is {self.decimal!r}.")
        if self.skip_rows is not None and self.skip_rows < 0:
            raise UsageError(f"skip_rows must not be negative, but it is {self.skip_rows}.")
        if self.delimiter is not None and self.delimiter == self.decimal:
            raise UsageError(f"delimiter and decimal cannot both be {self.delimiter!r}.")

    def is_comment(self, line: str) -> bool:
        """Return True if the line is a comment."""
        return line.lstrip().startswith(COMMENTS if self.comment is None else self.comment)

    def holds_data(self, line: str) -> bool:
        """Return True if the line is neither blank nor a comment."""
        return bool(line.strip()) and not self.is_comment(line)


@dataclasses.dataclass(frozen=True)
class Layout:
    """The position and format of a table in a text file.

    **Fields:**

    - `delimiter`, `decimal`: field separator and decimal mark.
    - `first_line`: index of the first line of data.
    - `titles`: of the columns; named "column0", ... if the file has none.
    - `texts`: the titles as written in the file, empty if there are none.
    - `kinds`: the kinds of the columns: "number", "clock" (times of day), "word" or "blank".
    - `title_line`: the line of titles, None if there is none outside of comments.
    - `thousands`: the thousands separator, None without one.
    - `rate`: sample rate in the lines above the data [Hz], None if there is none.
    """

    delimiter: str
    decimal: str
    first_line: int
    titles: list[Title]
    texts: list[str]
    kinds: list[str]
    title_line: str | None = None
    thousands: str | None = None
    rate: float | None = None


def sniff(lines: Sequence[str], dialect: Dialect, source: str) -> Layout:
    """Detect the layout of a table from the first lines."""
    skip = dialect.skip_rows or 0
    content = [i for i in range(skip, len(lines)) if dialect.holds_data(lines[i])][: 2 * SNIFFED_LINES]
    if not content:
        raise DataError(f"{source} holds no data after {skip} skipped rows; only blank lines or comments.")
    delimiter, decimal, rows = _separators([lines[i] for i in content], dialect, source)
    kinds = dict(zip(content, rows, strict=True))
    pure_rows, mixed_rows = list(filter(_is_pure, rows)), list(filter(_has_number, rows))
    width = len(_regular(pure_rows if 2 * len(pure_rows) >= len(mixed_rows) else mixed_rows)[0])
    # Some rows may end with a delimiter.
    kinds = {i: row[:width] if set(row[width:]) == {BLANK} else row for i, row in kinds.items()}
    if width > WIDEST:
        raise DataError(f"{source} has rows of more than {WIDEST} fields; check the delimiter.")
    first, pure, columns = _body(kinds, width)
    # LabVIEW's last title is Comment: only rows with a comment have this field.
    titled = max((len(kinds[i]) for i in content if i < first and set(kinds[i]) == {WORD}), default=0)
    if delimiter != " " and width < titled <= width + 3:
        columns += [BLANK] * (titled - width)
        width = titled
    above = list(lines[skip:first])
    titles = numbered(width)
    if dialect.header is not False:
        titles = titles_of(above, columns, delimiter, dialect.is_comment)
    fields = (field for i in content if i >= first for field in split(lines[i], delimiter))
    return Layout(
        delimiter,
        decimal,
        first,
        with_stated_units(titles, [*above, *(lines[i] for i in content if first <= i < pure)], columns),
        titles.texts,
        columns,
        titles.line,
        next(filter(None, (thousands_in(field, decimal) for field in fields)), None),
        stated_rate(above),
    )


def _separators(lines: list[str], dialect: Dialect, source: str) -> tuple[str, str, list[list[str]]]:
    """Find delimiter and decimal mark that give most rows of numbers.

    All rows must have the same width. If fewer than half of the lines are such rows, rows that mix numbers with words
    or times of day count too. The third result is the kinds of the fields of each line.
    """
    sample = lines[-SNIFFED_LINES:]
    # The tab also stands for a table of one column, which has no delimiter.
    occurring = [mark for mark in DELIMITERS if mark == "\t" or any(mark in line for line in sample)]
    chosen = [] if dialect.delimiter is None else [NAMED.get(dialect.delimiter, dialect.delimiter)]
    decimals = [mark for mark in (".", ",") if mark == "." or any(mark in line for line in sample)]
    # Between quotes a comma is not a delimiter and may be a decimal mark.
    quoted = any('"' in line for line in sample)
    pairs = [
        (delimiter, decimal)
        for delimiter in chosen or occurring
        for decimal in (decimals if dialect.decimal is None else [dialect.decimal])
        if delimiter != decimal or quoted
    ]
    kinds = lambda line, pair: [kind_of(field, pair[1]) for field in split(line, pair[0])[: WIDEST + 1]]
    read = {pair: [kinds(line, pair) for line in sample] for pair in pairs}

    def best(fits: Callable[[list[str]], bool]) -> tuple[tuple[str, str], tuple[int, int, int]]:
        scores = {pair: _score([row for row in rows if fits(row)]) for pair, rows in read.items()}
        return max(scores.items(), key=lambda item: item[1])

    pair, (count, *_) = best(_is_pure)
    if count < 0.5 * len(sample):
        mixed, (more, width, _) = best(_has_number)
        # A single column of words with some number is a text, not a table; so is a single row.
        if more > max(2 * count, 1) and width > 1:
            pair, count = mixed, more
    if not count:
        raise DataError(
            f"{source} holds no rows of numbers (its first line reads {brief(lines[0].strip())}); check the file, or "
            "give delimiter=, decimal= and skip_rows=."
        )
    return *pair, [*(kinds(line, pair) for line in lines[:-SNIFFED_LINES]), *read[pair]]


def _score(rows: list[list[str]]) -> tuple[int, int, int]:
    """Return the score of rows: count, width class, few words.

    The count is the number of rows with the commonest width. The width class is 1 for one field and 2 for more. The
    last entry is minus the mean number of words per row.
    """
    rows = _regular(rows)
    return (len(rows), min(len(rows[0]), 2), -sum(row.count(WORD) for row in rows) // len(rows)) if rows else (0, 0, 0)


def _regular(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows of the commonest width; the largest wins a tie."""
    count = Counter(map(len, rows))
    width = max(count, key=lambda each: (count[each], each), default=0)
    return [row for row in rows if len(row) == width]


def _has_number(row: list[str]) -> bool:
    return NUMBER in row


def _is_pure(row: list[str]) -> bool:
    """Return True if a row holds only numbers and blanks."""
    return NUMBER in row and WORD not in row and WATCH not in row


def _body(rows: dict[int, list[str]], width: int) -> tuple[int, int, list[str]]:
    """Return the first line of data, the first pure line, kinds.

    A pure line contains only data. The kinds are those of the columns.
    """
    fitting = {i: row for i, row in rows.items() if len(row) == width and NUMBER in row}
    tail = list(fitting.values())[-SNIFFED_LINES:]
    kinds = [_usual(Counter(row[i] for row in tail)) for i in range(width)]
    core = [i for i, kind in enumerate(kinds) if kind in (NUMBER, WATCH)]
    fits = [
        i for i, row in fitting.items() if all(field in (kind, BLANK) for field, kind in zip(row, kinds, strict=True))
    ]
    first = pure = (fits or list(fitting))[0]
    # An oscilloscope writes its settings next to the first rows of numbers.
    order = list(rows)
    for i in reversed(order[: order.index(first)]):
        if i not in fitting or any(rows[i][j] != kinds[j] for j in core):
            break
        first = i
    return first, pure, kinds


def _usual(count: Counter[str]) -> str:
    """Return the commonest kind of a column besides blanks.

    A column with less than 5 % other entries is blank.
    """
    blanks, rest = count[BLANK], {kind: n for kind, n in count.items() if kind != BLANK}
    if not rest:
        return BLANK
    kind = max(rest, key=lambda each: rest[each])
    return BLANK if rest[kind] < 0.05 * blanks else kind
