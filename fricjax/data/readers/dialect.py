"""The dialect of a text file: what separates its fields, marks its decimals and precedes its data.

Instruments and spreadsheets write tables in many ways. Whatever the caller does not say is read from the lines
themselves: the delimiter is the one under which the lines are all numbers and equally many; the data begin with the
first such line; the header is the line of words right before it, with a line of units in between where there is one.
"""

import dataclasses
import re
from collections import Counter

from ..errors import DataError, UsageError
from ..units import si_unit, split_header

COMMENTS = ("#", "%", "!", "//")
DELIMITERS = ("\t", ";", "|", ",", " ")
MISSING = ("", "nan", "na", "n/a", "null", "none", "-nan", "1.#qnan", "inf", "-inf", "+inf")
NAMED = {"tab": "\t", "\\t": "\t", "space": " ", "whitespace": " ", "comma": ",", "semicolon": ";"}
SNIFFED_LINES = 400


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
        """Whether the line is a remark, not data."""
        return line.lstrip().startswith(COMMENTS if self.comment is None else self.comment)


@dataclasses.dataclass(frozen=True)
class Layout:
    """Where and how the table stands: delimiter, decimal mark, index of its first data line, names and units."""

    delimiter: str
    decimal: str
    first_line: int
    names: list[str]
    units: list[str | None]


def split(line: str, delimiter: str) -> list[str]:
    """Fields of a line, stripped of blanks and quotes."""
    fields = line.split() if delimiter == " " else line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def number(field: str, decimal: str) -> float | None:
    """The value of a field, NaN where it is left out, None where it is no number."""
    if field.lower() in MISSING:
        return float("nan")
    text = field.replace(",", ".") if decimal == "," else field
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def sniff(lines: list[str], dialect: Dialect, source: str) -> Layout:
    """Finds the layout of a table of numbers in the lines of a file."""
    skip = dialect.skip_rows or 0
    content = [i for i in range(skip, len(lines)) if lines[i].strip() and not dialect.is_comment(lines[i])]
    if not content:
        raise DataError(f"{source} holds no data after {skip} skipped rows; only blank lines or comments.")
    content = content[:SNIFFED_LINES]
    delimiter, decimal, width = _separators([lines[i] for i in content], dialect, source)
    first = _first_data_line(lines, content, delimiter, decimal, width)
    names, units = _header(lines, content, first, width, delimiter, dialect)
    return Layout(delimiter, decimal, first, names, units)


def _separators(lines: list[str], dialect: Dialect, source: str) -> tuple[str, str, int]:
    """The pair of delimiter and decimal mark under which most lines are rows of numbers of one width."""
    best, best_score = None, (0, 0)
    for delimiter in DELIMITERS if dialect.delimiter is None else (NAMED.get(dialect.delimiter, dialect.delimiter),):
        for decimal in (".", ",") if dialect.decimal is None else (dialect.decimal,):
            if delimiter == decimal:
                continue
            widths = Counter(len(fields) for fields in _numeric_rows(lines, delimiter, decimal))
            if not widths:
                continue
            width, count = max(widths.items(), key=lambda item: (item[1], item[0]))
            score = (count, min(width, 2))
            if score > best_score:
                best, best_score = (delimiter, decimal, width), score
    if best is None:
        raise DataError(
            f"{source} holds no rows of numbers (its first line reads {lines[0].strip()[:60]!r}); check the file, or "
            "give delimiter=, decimal= and skip_rows=."
        )
    return best


def _numeric_rows(lines: list[str], delimiter: str, decimal: str) -> list[list[str]]:
    rows = []
    for line in lines:
        fields = split(line, delimiter)
        values = [number(field, decimal) for field in fields]
        if None not in values and any(value == value for value in values):
            rows.append(fields)
    return rows


def _first_data_line(lines: list[str], content: list[int], delimiter: str, decimal: str, width: int) -> int:
    return next(i for i in content if len((_numeric_rows([lines[i]], delimiter, decimal) or [[]])[0]) == width)


def _header(
    lines: list[str], content: list[int], first: int, width: int, delimiter: str, dialect: Dialect
) -> tuple[list[str], list[str | None]]:
    """Names and units from the lines before the data, numbered names where there are none."""
    numbered = [f"column{i}" for i in range(width)]
    if dialect.header is False:
        return numbered, [None] * width
    above = [_fields(lines[i], delimiter, width) for i in content if i < first][-2:]
    # A line of other content right above the data cuts them off from any header.
    rows = [row for row in above if row is not None] if above and above[-1] is not None else []
    if not rows:
        remarks = [line for line in lines[max(0, first - 3) : first] if dialect.is_comment(line)]
        marked = [_fields(line.lstrip().lstrip("#%!/ "), delimiter, width) for line in remarks[-1:]]
        rows = [row for row in marked if row is not None and width > 1]
    if not rows:
        return numbered, [None] * width
    if len(rows) == 2 and all(_bare_unit(field) for field in rows[1]):
        return rows[0], [field.strip("[]() ") or None for field in rows[1]]
    pairs = [split_header(field) for field in rows[-1]]
    return [name or numbered[i] for i, (name, _) in enumerate(pairs)], [unit for _, unit in pairs]


def _fields(line: str, delimiter: str, width: int) -> list[str] | None:
    """Fields of a header line if it names `width` columns: a unit after a blank does not count as a field."""
    fields = split(line, delimiter)
    if len(fields) != width and delimiter == " ":
        fields = split(re.sub(r"\s+([\[(])", r"_\1", line.strip()), delimiter)
        fields = [field.replace("_[", " [").replace("_(", " (") for field in fields]
    if len(fields) != width and delimiter == " ":
        fields = next((split(line, other) for other in DELIMITERS[:-1] if len(split(line, other)) == width), fields)
    several = width == 1 and re.search(r"[,;|\t]", line) is not None
    named = all(number(field, ".") is None or not field for field in fields)
    return fields if len(fields) == width and named and not several else None


def _bare_unit(field: str) -> bool:
    return field == "-" or si_unit(field.strip("[]() ") or "-") is not None
