"""Fields of text lines: number, time of day, word or blank."""

import re
from collections.abc import Iterable

import numpy as np

MISSING = frozenset((
    "", "nan", "na", "n/a", "null", "none", "-nan", "1.#qnan", "inf", "-inf", "+inf", "-", "--",
))  # fmt: skip
NUMBER, BLANK, WATCH, WORD = "number", "blank", "clock", "word"
# Thousands separators, as in 1,038.4. Decimals must follow, because 1,038 can also have a decimal comma.
_GROUPED = {
    ".": re.compile(r"[-+]?\d{1,3}(?P<mark>[,'])\d{3}(?:(?P=mark)\d{3})*\.\d+"),
    ",": re.compile(r"[-+]?\d{1,3}(?P<mark>[.'])\d{3}(?:(?P=mark)\d{3})*,\d+"),
}
_LONGEST = 100_000  # longest line in which quotes are respected [characters]


def split(line: str, delimiter: str) -> list[str]:
    """Split a line into fields, stripped of blanks and quotes.

    A delimiter between quotes does not separate.
    """
    if '"' in line and delimiter != " " and len(line) < _LONGEST:
        fields = re.split(rf'{re.escape(delimiter)}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)
    else:
        fields = line.split(None if delimiter == " " else delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def number(field: str, decimal: str) -> float | None:
    """Parse a field: NaN if missing, None if not a number."""
    if field.lower() in MISSING:
        return float("nan")
    mark = thousands_in(field, decimal)
    text = field if mark is None else field.replace(mark, "")
    if decimal == ",":
        text = text.replace(".", "_").replace(",", ".")
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def thousands_in(field: str, decimal: str) -> str | None:
    """Return the thousands separator of a field, None without one."""
    match = _GROUPED[decimal].fullmatch(field)
    return None if match is None else match["mark"]


def kind_of(field: str, decimal: str) -> str:
    """Return the kind: number, time of day, word or blank."""
    value = number(field, decimal)
    if value is not None:
        return NUMBER if value == value else BLANK
    return WATCH if is_clock(field) else WORD


CLOCK = re.compile(
    r"(?:(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})[T ]\s*)?"
    r"(?P<hours>\d{1,2}):(?P<minutes>\d{1,2})(?::(?P<seconds>\d{1,2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?Z?"
    r"|(?P<m>\d{1,3}):(?P<s>\d{1,2}[.,]\d+)"
)
_DAY = 86400.0


def is_clock(field: str) -> bool:
    """Return True for a time of day, with or without date."""
    return ":" in field and len(field) < 40 and CLOCK.fullmatch(field) is not None


def seconds_of(fields: Iterable[object]) -> np.ndarray:
    """Convert times of day to seconds since the first midnight, shape (rows,).

    Fields that are not a time of day become NaN. The date is ignored: a decay that passes midnight keeps counting, and
    no decay lasts half a day.
    """
    seconds = np.array([_seconds(str(field).strip()) for field in fields], dtype=np.float64)
    known = np.flatnonzero(~np.isnan(seconds))
    seconds[known] += _DAY * np.cumsum(np.diff(seconds[known], prepend=seconds[known[:1]]) < -0.5 * _DAY)
    return seconds


def _seconds(field: str) -> float:
    match = CLOCK.fullmatch(field) if len(field) < 40 else None
    if match is None:
        return float("nan")
    if match["m"]:
        return 60.0 * float(match["m"]) + float(match["s"].replace(",", "."))
    seconds = re.sub(r"[,:]", ".", match["seconds"] or "0")
    hours = int(match["hours"])
    if match["half"]:
        hours = hours % 12 + (12 if match["half"][0] in "pP" else 0)
    return 3600.0 * hours + 60.0 * int(match["minutes"]) + float(seconds)
