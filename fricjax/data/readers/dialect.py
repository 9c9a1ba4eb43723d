"""The dialect of a text file: what separates its fields, marks its decimals and precedes its data.

Instruments and spreadsheets write tables in many ways. Whatever the caller does not say is read from the lines
themselves: the delimiter is the one under which most lines are rows of numbers, equally many; columns of words or of
times of day may stand among them; the titles are the line of words right above the data, with a line of units below
it where there is one.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence

from ...errors import DataError, UsageError, brief
from .fields import BLANK, NUMBER, WATCH, WORD, kind_of, split, thousands_in
from .header import Title
from .titles import advice_of, numbered, titles_of, with_stated_units

COMMENTS = ("#", "%", "!", "//")
DELIMITERS = ("\t", ";", "|", ",", " ")
NAMED = {"tab": "\t", "\\t": "\t", "space": " ", "whitespace": " ", "comma": ",", "semicolon": ";"}
SNIFFED_LINES = 200  # of the rows, from which the layout is recognised
WIDEST = 10_000  # fields in a row; a table of more columns than that is no record of runs


@dataclasses.dataclass(frozen=True)
class Dialect:
    """How a table of numbers is written; None for what is to be found in the file."""

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
        """Whether the line is a comment, not data."""
        return line.lstrip().startswith(COMMENTS if self.comment is None else self.comment)

    def holds_data(self, line: str) -> bool:
        """Whether the line is neither blank nor a comment."""
        return bool(line.strip()) and not self.is_comment(line)


@dataclasses.dataclass(frozen=True)
class Layout:
    """Where and how the table stands.

    **Fields:**

    - `delimiter`, `decimal`: between fields, and within numbers.
    - `first_line`: index of the first line of data.
    - `titles`: of the columns; the names are "column0", ... where there are none.
    - `texts`: the titles as the file writes them, empty where there are none.
    - `kinds`: what the columns hold: "number", "clock" (times of day), "word" or "blank".
    - `title_line`: the line of titles, None where there is none outside of comments.
    - `thousands`: what sets thousands apart, None for nothing.
    - `advice`: what the lines above the data say about the rate, for a message.
    """

    delimiter: str
    decimal: str
    first_line: int
    titles: list[Title]
    texts: list[str]
    kinds: list[str]
    title_line: str | None = None
    thousands: str | None = None
    advice: str = ""

    @property
    def names(self) -> list[str]:
        """Names of the columns, without units."""
        return [title.name for title in self.titles]

    @property
    def units(self) -> list[str | None]:
        """Units of the columns, None where none is named."""
        return [title.unit for title in self.titles]


def sniff(lines: Sequence[str], dialect: Dialect, source: str) -> Layout:
    """Finds the layout of a table of numbers in the first lines of a file.

    Raises:
        DataError: no rows of numbers, or rows of too many fields.
    """
    skip = dialect.skip_rows or 0
    content = [i for i in range(skip, len(lines)) if dialect.holds_data(lines[i])]
    if not content:
        raise DataError(f"{source} holds no data after {skip} skipped rows; only blank lines or comments.")
    delimiter, decimal = _separators([lines[i] for i in content[: 2 * SNIFFED_LINES]], dialect, source)
    rows = {i: split(lines[i], delimiter) for i in content[: 2 * SNIFFED_LINES]}
    kinds = {i: [kind_of(field, decimal) for field in row] for i, row in rows.items()}
    width = _width(list(kinds.values()))
    if width > WIDEST:
        raise DataError(f"{source} has rows of {width} fields, but at most {WIDEST} are read; check the delimiter.")
    first, pure, columns = _body(kinds, width)
    # LabVIEW's last title is Comment: rows have that field only where there is one.
    titled = max((len(kinds[i]) for i in content if i < first and i in kinds and set(kinds[i]) == {WORD}), default=0)
    if delimiter != " " and width < titled <= width + 3:
        columns += [BLANK] * (titled - width)
        width = titled
    above = list(lines[skip:first])
    titles = numbered(width)
    if dialect.header is not False:
        titles = titles_of(above, columns, delimiter, dialect.is_comment)
    marks = (thousands_in(field, decimal) for i, row in rows.items() if i >= first for field in row)
    return Layout(
        delimiter,
        decimal,
        first,
        with_stated_units(titles, [*above, *(lines[i] for i in content if first <= i < pure)], columns),
        titles.texts,
        columns,
        titles.line,
        next((mark for mark in marks if mark), None),
        advice_of(above),
    )


def _separators(lines: list[str], dialect: Dialect, source: str) -> tuple[str, str]:
    """The pair of delimiter and decimal mark under which most lines are rows of numbers of one width.

    Where that are fewer than half of the lines, rows that hold words or times of day beside numbers count too.
    """
    sample = lines[-SNIFFED_LINES:]
    # The tab stands for a table of one column too, in which nothing separates.
    occurring = [mark for mark in DELIMITERS if mark == "\t" or any(mark in line for line in sample)]
    chosen = [] if dialect.delimiter is None else [NAMED.get(dialect.delimiter, dialect.delimiter)]
    # Between quotes a comma is no delimiter, and may mark decimals.
    quoted = any('"' in line for line in sample)
    pairs = [
        (delimiter, decimal)
        for delimiter in chosen or occurring
        for decimal in ((".", ",") if dialect.decimal is None else (dialect.decimal,))
        if delimiter != decimal or quoted
    ]
    read = {
        pair: [[kind_of(f, pair[1]) for f in split(line, pair[0])[: WIDEST + 1]] for line in sample] for pair in pairs
    }
    pure = {pair: [row for row in rows if _is_pure(row)] for pair, rows in read.items()}
    best = max(pairs, key=lambda pair: _score(pure[pair]))
    count = _score(pure[best])[0]
    if count < 0.5 * len(sample):
        mixed = {pair: [row for row in rows if NUMBER in row] for pair, rows in read.items()}
        other = max(pairs, key=lambda pair: _score(mixed[pair]))
        # A single column of words with a number among them is a text, not a table, and so is a single row.
        if _score(mixed[other])[0] > max(2 * count, 1) and _score(mixed[other])[1] > 1:
            best, count = other, _score(mixed[other])[0]
    if not count:
        raise DataError(
            f"{source} holds no rows of numbers (its first line reads {brief(lines[0].strip())}); check the file, or "
            "give delimiter=, decimal= and skip_rows=."
        )
    return best


def _score(rows: list[list[str]]) -> tuple[int, int, int]:
    """How many rows are of one width, whether they are wider than one field, and how few of their fields are words."""
    if not rows:
        return 0, 0, 0
    width, count = _commonest_width(rows)
    words = sum(cell == WORD for row in rows if len(row) == width for cell in row)
    return count, min(width, 2), -words // count


def _width(rows: list[list[str]]) -> int:
    """Fields in most rows that hold numbers: of those without words where there are such."""
    pure = [row for row in rows if _is_pure(row)]
    mixed = [row for row in rows if NUMBER in row]
    return _commonest_width(pure if 2 * len(pure) >= len(mixed) else mixed)[0]


def _is_pure(row: list[str]) -> bool:
    """Whether a row holds numbers and blanks only."""
    return NUMBER in row and WORD not in row and WATCH not in row


def _commonest_width(rows: list[list[str]]) -> tuple[int, int]:
    """Fields in most rows, of several equally common numbers the largest, and how many rows have so many."""
    return max(Counter(map(len, rows)).items(), key=lambda item: (item[1], item[0]))


def _body(rows: dict[int, list[str]], width: int) -> tuple[int, int, list[str]]:
    """Index of the first line of data, that of the first line that holds nothing else, and what the columns hold."""
    fitting = {i: row for i, row in rows.items() if len(row) == width and NUMBER in row}
    tail = list(fitting.values())[-SNIFFED_LINES:]
    kinds = [_usual(Counter(row[i] for row in tail)) for i in range(width)]
    core = [i for i, kind in enumerate(kinds) if kind in (NUMBER, WATCH)]
    fits = [
        i for i, row in fitting.items() if all(field in (kind, BLANK) for field, kind in zip(row, kinds, strict=True))
    ]
    first = pure = (fits or list(fitting))[0]
    # An oscilloscope writes its settings beside the first rows of numbers.
    order = list(rows)
    for i in reversed(order[: order.index(first)]):
        if i not in fitting or any(rows[i][j] != kinds[j] for j in core):
            break
        first = i
    return first, pure, kinds


def _usual(count: Counter[str]) -> str:
    """What a column holds: its commonest kind besides blanks; a column that is all but blank is one of blanks."""
    blanks, rest = count[BLANK], {kind: n for kind, n in count.items() if kind != BLANK}
    if not rest:
        return BLANK
    kind = max(rest, key=lambda each: rest[each])
    return BLANK if rest[kind] < 0.05 * blanks else kind
