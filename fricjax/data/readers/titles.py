"""The titles above a table, with units from the lines around."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from .fields import BLANK, NUMBER, WORD, kind_of, number, split
from .header import UNSCALED, Title, is_time, is_unit, measures, split_title

_NEAR = 6  # number of lines above the data to search for titles and units, without rules and blank lines
_RULE = re.compile(r"[\s\-=_*+|~.:;,]*[-=_*+~]{2}[\s\-=_*+|~.:;,]*")
_STATED = ("y_unit_label", "vertical units", "vertical unit", "y units", "y unit", "yunit", "units", "unit", "einheit")
_RATE = re.compile(
    r"(?:(?:sampl|scan|acquisition|abtast)\w*[ _]?(?:rate|freq\w*)?|\brate)[^\d\n]{0,20}?(\d+(?:\.\d+)?)\s*(k?)Hz",
    re.IGNORECASE,
)
# Names that need no unit behind the number: `ActualRate = 5000`, `Sample rate (Hz);1000`.
_NAMED_RATE = re.compile(
    r"(?:(?:actual|sampl\w+|scan|acquisition|abtast)[ _]?(?:rate|freq\w*)|\bfs)(?:[ _]*[\[(](k?)Hz[\])])?"
    r"[ \t\"']*[:=;,\t][ \t\"']*(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)(?![\d.]*[ \t]*[a-zA-Z])",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    r"(?:delta_?x|sampl\w+ (?:interval|period))[^\d\n]{0,20}?(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)", re.IGNORECASE
)
_PREAMBLE = 20_000  # length of the preamble to search for a rate [characters]


class Titles(NamedTuple):
    """The titles above the columns.

    `titles` are split into their parts, or numbered if there are none. `texts` are the titles as written in the file,
    empty if there are none. `line` is the text of their line, None if it is a comment or missing.
    """

    titles: list[Title]
    texts: list[str]
    line: str | None = None


def numbered(width: int) -> Titles:
    """Return numbered titles, for columns without any."""
    return Titles([Title(f"column{i}") for i in range(width)], [""] * width)


def titles_of(above: Sequence[str], kinds: list[str], delimiter: str, is_comment: Callable[[str], bool]) -> Titles:
    """Find the titles of a table in the lines above its data.

    Titles in comments count only if there are no others.
    """
    lines = [line for line in above if line.strip() and not _RULE.fullmatch(line)]
    rows_above: list[tuple[str, list[str]]] = []
    # The titles end at a line of another kind, such as a preamble or a remark.
    for line in reversed([line for line in lines if not is_comment(line)][-_NEAR:]):
        fields = _fields(line, kinds, delimiter)
        if fields is None:
            break
        rows_above.insert(0, (line, fields))
    rows, in_comments = [fields for _, fields in rows_above], not rows_above
    if in_comments and len(kinds) > 1:
        comments = [line.lstrip().lstrip("#%!/ ") for line in lines if is_comment(line)][-3:]
        rows = [row for row in (_fields(line, kinds, delimiter) for line in comments) if row is not None][-2:]
    if not rows:
        return numbered(len(kinds))
    units = [""] * len(kinds)
    while len(rows) > 1 and _are_units(rows[-1]) and not _are_units(rows[-2]):
        units = [field if is_unit(field) else "" for field in map(_bare, rows.pop())]
    names = numbered(len(kinds)).titles
    if not any(units) and all(
        measures(_bare(f)) in ("m", "rad", "s") or _bare(f).lower() in UNSCALED for f in rows[-1]
    ):
        # The row has only units, no names.
        return Titles([title._replace(unit=_bare(f)) for title, f in zip(names, rows[-1], strict=True)], rows[-1])
    texts = [text or names[i].name for i, text in enumerate(rows[-1])]
    titles = [
        split_title(text)._replace(**({"unit": unit} if unit else {})) for text, unit in zip(texts, units, strict=True)
    ]
    return Titles(titles, texts, None if in_comments else rows_above[len(rows) - 1][0])


def with_stated_units(titles: Titles, preamble: Sequence[str], kinds: list[str]) -> list[Title]:
    """Add the units of a preamble to the titles.

    LabVIEW and oscilloscopes write such units for all columns except the time.
    """
    units: list[str] = []
    for line in preamble:
        key, *words = (word.strip() for word in re.split(r"[:=\t;,]", line.strip("#%!/ ")))
        if key.lower() in _STATED and not units:
            units = [word for word in words if is_unit(word)]
    values = [
        i
        for i, kind in enumerate(kinds)
        if kind == NUMBER and not is_time(titles.titles[i].name, titles.titles[i].unit)
    ]
    if not any(titles.texts) and len(values) > 1:
        values = values[1:]  # without titles the first of several columns is the time
    stated = dict(zip(values, units, strict=False))
    return [title._replace(unit=title.unit or stated.get(i)) for i, title in enumerate(titles.titles)]


def stated_rate(preamble: Sequence[str]) -> float | None:
    """Return the sample rate in a preamble [Hz], None if unknown."""
    text = "\n".join(preamble)[-_PREAMBLE:]
    rate, named, interval = _RATE.search(text), _NAMED_RATE.search(text), _INTERVAL.search(text)
    if rate is not None:
        return float(rate[1]) * (1e3 if rate[2] else 1) or None
    if named is not None:
        return float(named[2]) * (1e3 if named[1] else 1) or None
    step = 0.0 if interval is None else number(interval[1].replace(",", "."), ".") or 0.0
    return 1.0 / step if step > 0 else None


def _fields(line: str, kinds: list[str], delimiter: str) -> list[str] | None:
    """Return the titles in a line, None if it is another line.

    There must be one title for each column.
    """
    width, fields = len(kinds), split(line, delimiter)
    if len(fields) != width and delimiter == " ":
        # A unit after a blank belongs to its title. Titles may be separated by several blanks or by another mark.
        joined = split(re.sub(r"\s+([\[(])", r"_\1", line.strip()), delimiter)
        joined = [field.replace("_[", " [").replace("_(", " (") for field in joined]
        wide = [field for field in re.split(r"\s{2,}", line.strip()) if field]
        fields = next((option for option in (joined, wide) if len(option) == width), fields)
    elif len(fields) != width and len(fields) > 1:
        # Delimiters at the end of this line or of the rows add empty fields.
        spare = all(kind == BLANK for kind in kinds[len(fields) :])
        fields = [*fields[:width], *([""] * (width - len(fields)) if spare else [])]
    if len(fields) != width:
        # Some programs separate the titles by another mark than the numbers.
        fields = next((other for mark in "\t;|," if len(other := split(line, mark)) == width), fields)
    several = width == 1 and re.search(r"[,;|\t]", line) is not None
    words = [kind_of(field, ".") for field in fields]
    if len(fields) != width or several or WORD not in words:
        return None
    return fields if all(word in (WORD, BLANK) or kinds[i] != word for i, word in enumerate(words)) else None


def _are_units(fields: list[str]) -> bool:
    """Return True if a row holds units.

    It may also hold its name, blanks, or numbers, as oscilloscopes write them next to units.
    """
    known = [is_unit(_bare(field)) for field in fields]
    rest = [field for field, unit in zip(fields, known, strict=True) if not unit]
    return any(known) and all(kind_of(field, ".") != WORD or field.lower() in _STATED for field in rest)


def _bare(field: str) -> str:
    return field.strip("[]() ")
