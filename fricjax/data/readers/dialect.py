"""The dialect of a text file: what separates its fields, marks its decimals and precedes its data.

Instruments and spreadsheets write tables in many ways. Whatever the caller does not say is read from the lines
themselves: the delimiter is the one under which most lines are rows of numbers, equally many; columns of words or of
times of day may stand among them; the titles are the line of words right above the data, with a line of units below
it where there is one.
"""

import dataclasses
import re
from collections import Counter
from collections.abc import Sequence

from ..errors import DataError, UsageError
from ..header import UNSCALED, Title, is_time, is_unit, measures, split_title
from .clock import is_clock

COMMENTS = ("#", "%", "!", "//")
DELIMITERS = ("\t", ";", "|", ",", " ")
MISSING = ("", "nan", "na", "n/a", "null", "none", "-nan", "1.#qnan", "inf", "-inf", "+inf", "-", "--")
NAMED = {"tab": "\t", "\\t": "\t", "space": " ", "whitespace": " ", "comma": ",", "semicolon": ";"}
SNIFFED_LINES = 400
WIDEST = 10_000  # fields in a row; a table of more columns than that is no record of runs
_TITLE_LINES = 6  # lines above the data among which titles and units are sought, rules and blank ones not counted
_RULE = re.compile(r"[\s\-=_*+|~.:;,]*[-=_*+~]{2}[\s\-=_*+|~.:;,]*")
_RATE = re.compile(r"(?:sampl|scan|acquisition|abtast)\w*[ _]?(?:rate|freq\w*)?[^\d\n]{0,20}?(\d+(?:\.\d+)?)\s*(k?)Hz", re.I)
_INTERVAL = re.compile(r"(?:delta_?x|sampl\w+ (?:interval|period))[^\d\n]{0,20}?(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)", re.I)
# Thousands set apart, as in 1,038.4: only where decimals follow, since 1,038 is as well a number with a decimal comma.
_GROUPED = {
    ".": re.compile(r"[-+]?\d{1,3}(?P<mark>[,'])\d{3}(?:(?P=mark)\d{3})*\.\d+"),
    ",": re.compile(r"[-+]?\d{1,3}(?P<mark>[.'])\d{3}(?:(?P=mark)\d{3})*,\d+"),
}
_UNIT_KEYS = ("y_unit_label", "vertical units", "vertical unit", "y units", "y unit", "yunit", "units", "unit", "einheit")
NUMBER, BLANK, WATCH, WORD = "number", "blank", "clock", "word"


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

    def holds_data(self, line: str) -> bool:
        """Whether the line is neither blank nor a remark."""
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
    - `title_line`: index of the line of titles, None where there is none outside of remarks.
    - `thousands`: what sets thousands apart, None for nothing.
    - `advice`: what the lines above the data say about the rate, for a message.
    """

    delimiter: str
    decimal: str
    first_line: int
    titles: list[Title]
    texts: list[str]
    kinds: list[str]
    title_line: int | None = None
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


def split(line: str, delimiter: str) -> list[str]:
    """Fields of a line, stripped of blanks and quotes; a delimiter between quotes does not separate."""
    if delimiter == " ":
        fields = line.split()
    elif '"' in line:
        fields = re.split(rf'{re.escape(delimiter)}(?=(?:[^"]*"[^"]*")*[^"]*$)', line[:100_000])
    else:
        fields = line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def number(field: str, decimal: str) -> float | None:
    """The value of a field, NaN where it is left out, None where it is no number."""
    if field.lower() in MISSING:
        return float("nan")
    grouped = _GROUPED[decimal].fullmatch(field)
    text = field.replace(grouped["mark"], "") if grouped else field
    text = text.replace(",", ".") if decimal == "," else text
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def kind_of(field: str, decimal: str) -> str:
    """What a field holds: a number, a time of day, a word, or nothing."""
    value = number(field, decimal)
    if value is not None:
        return NUMBER if value == value else BLANK
    return WATCH if is_clock(field) else WORD


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
    first, columns = _body(kinds, width)
    # LabVIEW's last title is Comment: rows have that field only where there is one.
    titled = max((len(kinds[i]) for i in content if i < first and i in kinds and set(kinds[i]) == {WORD}), default=0)
    if delimiter != " " and width < titled <= width + 3:
        columns += [BLANK] * (titled - width)
        width = titled
    above = [i for i in range(skip, first) if lines[i].strip()]
    titles, texts = _titles([lines[i] for i in above], width, delimiter, dialect, columns)
    titles = _with_stated_units(titles, [lines[i] for i in above])
    title_line = next((i for i in reversed(above) if any(texts) and _fields(lines[i], delimiter, width, columns) == texts), None)
    fields = (field for i, row in rows.items() if i >= first for field in row)
    thousands = next((match["mark"] for field in fields if (match := _GROUPED[decimal].fullmatch(field))), None)
    advice = _advice([lines[i] for i in above])
    return Layout(delimiter, decimal, first, titles, texts, columns, title_line, thousands, advice)


def _separators(lines: list[str], dialect: Dialect, source: str) -> tuple[str, str]:
    """The pair of delimiter and decimal mark under which most lines are rows of numbers of one width.

    Where that are fewer than half of the lines, rows that hold words or times of day beside numbers count too.
    """
    pairs = [
        (delimiter, decimal)
        for delimiter in (DELIMITERS if dialect.delimiter is None else (NAMED.get(dialect.delimiter, dialect.delimiter),))
        for decimal in ((".", ",") if dialect.decimal is None else (dialect.decimal,))
        if delimiter != decimal
    ]
    sample = lines[-SNIFFED_LINES:]
    read = {pair: [[kind_of(f, pair[1]) for f in split(line, pair[0])[: WIDEST + 1]] for line in sample] for pair in pairs}
    pure = {pair: [row for row in rows if NUMBER in row and not {WORD, WATCH} & set(row)] for pair, rows in read.items()}
    best = max(pairs, key=lambda pair: _score(pure[pair]))
    count = _score(pure[best])[0]
    if count < 0.5 * len(sample):
        mixed = {pair: [row for row in rows if NUMBER in row] for pair, rows in read.items()}
        other = max(pairs, key=lambda pair: _score(mixed[pair]))
        # A single column of words with a number among them is a text, not a table.
        if _score(mixed[other])[0] > 2 * count and _score(mixed[other])[1] > 1:
            best, count = other, _score(mixed[other])[0]
    if not count:
        raise DataError(
            f"{source} holds no rows of numbers (its first line reads {lines[0].strip()[:60]!r}); check the file, or "
            "give delimiter=, decimal= and skip_rows=."
        )
    return best


def _score(rows: list[list[str]]) -> tuple[int, int, int]:
    """How many rows are of one width, whether they are wider than one field, and how few of their fields are words."""
    if not rows:
        return 0, 0, 0
    width, count = max(Counter(map(len, rows)).items(), key=lambda item: (item[1], item[0]))
    words = sum(cell == WORD for row in rows if len(row) == width for cell in row)
    return count, min(width, 2), -words // count


def _width(rows: list[list[str]]) -> int:
    """Fields in most rows that hold numbers: of those without words where there are such."""
    pure = [row for row in rows if NUMBER in row and WORD not in row and WATCH not in row]
    mixed = [row for row in rows if NUMBER in row]
    among = pure if 2 * len(pure) >= len(mixed) else mixed
    return max(Counter(map(len, among)).items(), key=lambda item: (item[1], item[0]))[0]


def _body(rows: dict[int, list[str]], width: int) -> tuple[int, list[str]]:
    """Index of the first line of data, and what its columns hold."""
    fitting = {i: row for i, row in rows.items() if len(row) == width and NUMBER in row}
    tail = list(fitting.values())[-SNIFFED_LINES:]
    kinds = [_usual(Counter(row[i] for row in tail)) for i in range(width)]
    core = [i for i, kind in enumerate(kinds) if kind in (NUMBER, WATCH)]
    fits = [i for i, row in fitting.items() if all(field in (kind, BLANK) for field, kind in zip(row, kinds, strict=True))]
    first = (fits or list(fitting))[0]
    # An oscilloscope writes its settings beside the first rows of numbers.
    order = list(rows)
    for i in reversed(order[: order.index(first)]):
        if i not in fitting or any(rows[i][j] != kinds[j] for j in core):
            break
        first = i
    return first, kinds


def _usual(count: Counter[str]) -> str:
    """What a column holds: its commonest kind besides blanks; a column that is all but blank is one of blanks."""
    blanks, rest = count[BLANK], {kind: n for kind, n in count.items() if kind != BLANK}
    if not rest:
        return BLANK
    kind = max(rest, key=lambda each: rest[each])
    return BLANK if rest[kind] < 0.05 * blanks else kind


def _titles(
    above: list[str], width: int, delimiter: str, dialect: Dialect, kinds: list[str]
) -> tuple[list[Title], list[str]]:
    """Titles from the lines above the data, numbered ones where there are none."""
    numbered = [Title(f"column{i}") for i in range(width)], [""] * width
    if dialect.header is False:
        return numbered
    lines = [line for line in above if not _RULE.fullmatch(line)]
    content = [line for line in lines if not dialect.is_comment(line)][-_TITLE_LINES:]
    rows: list[list[str]] = []
    # The titles end where a line of another kind begins: a preamble, or the remark of a person.
    for line in reversed(content):
        fields = _fields(line, delimiter, width, kinds)
        if fields is None:
            break
        rows.insert(0, fields)
    if not rows:
        remarks = [line for line in lines if dialect.is_comment(line)][-3:]
        marked = [_fields(line.lstrip().lstrip("#%!/ "), delimiter, width, kinds) for line in remarks]
        rows = [row for row in marked if row is not None and width > 1][-2:]
    if not rows:
        return numbered
    units = [""] * width
    while len(rows) > 1 and _are_units(rows[-1]) and not _are_units(rows[-2]):
        units = [field if is_unit(field) else "" for field in map(_bare, rows.pop())]
    if not any(units) and all(measures(_bare(f)) in ("m", "rad", "s") or _bare(f).lower() in UNSCALED for f in rows[-1]):
        # No names, only units.
        return [Title(title.name, _bare(field)) for title, field in zip(numbered[0], rows[-1], strict=True)], rows[-1]
    texts = [text or numbered[0][i].name for i, text in enumerate(rows[-1])]
    split_ = [split_title(text) for text in texts]
    return [title._replace(unit=units[i] or title.unit) for i, title in enumerate(split_)], texts


def _with_stated_units(titles: list[Title], above: list[str]) -> list[Title]:
    """The titles with the units that a preamble states, as LabVIEW and oscilloscopes do for the columns but the time."""
    units: list[str] = []
    for line in above:
        key, *words = (word.strip() for word in re.split(r"[:=\t;,]", line.strip("#%!/ ")))
        if key.lower() in _UNIT_KEYS:
            units = units or [word for word in words if is_unit(word)]
    values = [title for title in titles if not is_time(title.name, title.unit) and title.name.lower() != "comment"]
    stated = dict(zip(values, units, strict=False))
    return [title._replace(unit=title.unit or stated.get(title)) for title in titles]


def _are_units(fields: list[str]) -> bool:
    """Whether a row holds units: blanks, and the numbers that an oscilloscope puts beside them, may be among them."""
    known = [is_unit(_bare(field)) for field in fields]
    return any(known) and all(unit or kind_of(field, ".") != WORD for unit, field in zip(known, fields, strict=True))


def _bare(field: str) -> str:
    return field.strip("[]() ")


def _fields(line: str, delimiter: str, width: int, kinds: list[str]) -> list[str] | None:
    """Fields of a line of titles for `width` columns: a unit after a blank does not count as a field."""
    fields = split(line, delimiter)
    if len(fields) != width and delimiter == " ":
        joined = split(re.sub(r"\s+([\[(])", r"_\1", line.strip()), delimiter)
        fields = [field.replace("_[", " [").replace("_(", " (") for field in joined]
    if len(fields) != width and delimiter == " ":
        wide = [field for field in re.split(r"\s{2,}", line.strip()) if field]
        others = (split(line, other) for other in DELIMITERS[:-1])
        fields = next((option for option in (wide, *others) if len(option) == width), fields)
    if delimiter != " " and len(fields) != width and len(fields) > 1:
        # Trailing delimiters, or a title such as LabVIEW's Comment over a column that is left out.
        spare = all(kind == BLANK for kind in kinds[len(fields) :])
        fields = fields[:width] if len(fields) > width else [*fields, *[""] * (width - len(fields))] if spare else fields
    several = width == 1 and re.search(r"[,;|\t]", line) is not None
    words = [kind_of(field, ".") for field in fields]
    named = WORD in words and all(
        word in (WORD, BLANK) or kinds[i] != word for i, word in enumerate(words[:width])
    )
    return fields if len(fields) == width and named and not several else None


def _advice(above: list[str]) -> str:
    """The rate that a preamble states."""
    text = "\n".join(above)[-20_000:]
    rate, interval = _RATE.search(text), _INTERVAL.search(text)
    if rate is not None:
        return f"; it says {float(rate[1]) * (1e3 if rate[2] else 1):g} Hz"
    step = 0.0 if interval is None else number(interval[1].replace(",", "."), ".") or 0.0
    return f"; it says {1.0 / step:g} Hz" if step > 0 else ""
