"""The titles above a table: the line of words right above the data, with units in it, below it, or in the preamble."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from .fields import BLANK, NUMBER, WORD, kind_of, number, split
from .header import UNSCALED, Title, is_time, is_unit, measures, split_title

_NEAR = 6  # lines above the data among which titles and units are sought, rules and blank ones not counted
_RULE = re.compile(r"[\s\-=_*+|~.:;,]*[-=_*+~]{2}[\s\-=_*+|~.:;,]*")
_STATED = ("y_unit_label", "vertical units", "vertical unit", "y units", "y unit", "yunit", "units", "unit", "einheit")
_RATE = re.compile(
    r"(?:(?:sampl|scan|acquisition|abtast)\w*[ _]?(?:rate|freq\w*)?|\brate)[^\d\n]{0,20}?(\d+(?:\.\d+)?)\s*(k?)Hz",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    r"(?:delta_?x|sampl\w+ (?:interval|period))[^\d\n]{0,20}?(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)", re.IGNORECASE
)
_PREAMBLE = 20_000  # characters of a preamble in which a rate is sought


class Titles(NamedTuple):
    """What stands above the columns.

    `titles` are taken apart, and named by their numbers where there are none; `texts` is how the file writes them,
    empty where it does not; `line` the text of their line, None where that is a comment or there is none.
    """

    titles: list[Title]
    texts: list[str]
    line: str | None = None


def numbered(width: int) -> Titles:
    """The titles of columns without any."""
    return Titles([Title(f"column{i}") for i in range(width)], [""] * width)


def titles_of(above: Sequence[str], kinds: list[str], delimiter: str, is_comment: Callable[[str], bool]) -> Titles:
    """The titles of a table.

    Args:
        above: the lines above the data.
        kinds: what its columns hold.
        delimiter: between fields.
        is_comment: whether a line is a comment; titles may stand in one, if nowhere else.
    """
    lines = [line for line in above if line.strip() and not _RULE.fullmatch(line)]
    rows_above: list[tuple[str, list[str]]] = []
    # The titles end where a line of another kind begins: a preamble, or the comment of a person.
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
        # No names, only units.
        return Titles([title._replace(unit=_bare(f)) for title, f in zip(names, rows[-1], strict=True)], rows[-1])
    texts = [text or names[i].name for i, text in enumerate(rows[-1])]
    titles = [
        split_title(text)._replace(**({"unit": unit} if unit else {})) for text, unit in zip(texts, units, strict=True)
    ]
    return Titles(titles, texts, None if in_comments else rows_above[len(rows) - 1][0])


def with_stated_units(titles: Titles, preamble: Sequence[str], kinds: list[str]) -> list[Title]:
    """The titles with the units that a preamble states, as LabVIEW and oscilloscopes do for all but the time."""
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
        values = values[1:]  # without any titles the first of several columns is the time
    stated = dict(zip(values, units, strict=False))
    return [title._replace(unit=title.unit or stated.get(i)) for i, title in enumerate(titles.titles)]


def advice_of(preamble: Sequence[str]) -> str:
    """What a preamble says of the rate, for a message; empty where it says nothing."""
    text = "\n".join(preamble)[-_PREAMBLE:]
    rate, interval = _RATE.search(text), _INTERVAL.search(text)
    if rate is not None:
        return f"; it says {float(rate[1]) * (1e3 if rate[2] else 1):g} Hz"
    step = 0.0 if interval is None else number(interval[1].replace(",", "."), ".") or 0.0
    return f"; it says {1.0 / step:g} Hz" if step > 0 else ""


def _fields(line: str, kinds: list[str], delimiter: str) -> list[str] | None:
    """Fields of a line of titles, one for each column; None where it is none."""
    width, fields = len(kinds), split(line, delimiter)
    if len(fields) != width and delimiter == " ":
        # A unit after a blank is no field of its own; titles may stand apart by several blanks, or by another mark.
        joined = split(re.sub(r"\s+([\[(])", r"_\1", line.strip()), delimiter)
        joined = [field.replace("_[", " [").replace("_(", " (") for field in joined]
        wide = [field for field in re.split(r"\s{2,}", line.strip()) if field]
        others = (split(line, other) for other in "\t;|,")
        fields = next((option for option in (joined, wide, *others) if len(option) == width), fields)
    elif len(fields) != width and len(fields) > 1:
        # Delimiters at the end of this line or of the rows.
        spare = all(kind == BLANK for kind in kinds[len(fields) :])
        fields = [*fields[:width], *([""] * (width - len(fields)) if spare else [])]
    several = width == 1 and re.search(r"[,;|\t]", line) is not None
    words = [kind_of(field, ".") for field in fields]
    if len(fields) != width or several or WORD not in words:
        return None
    return fields if all(word in (WORD, BLANK) or kinds[i] != word for i, word in enumerate(words)) else None


def _are_units(fields: list[str]) -> bool:
    """Whether a row holds units, and perhaps its name, blanks, or numbers as an oscilloscope puts them beside units."""
    known = [is_unit(_bare(field)) for field in fields]
    rest = [field for field, unit in zip(fields, known, strict=True) if not unit]
    return any(known) and all(kind_of(field, ".") != WORD or field.lower() in _STATED for field in rest)


def _bare(field: str) -> str:
    return field.strip("[]() ")
