"""Fields of a line of text, and what each holds: a number, a time of day, a word, or nothing."""

import re

from .clock import is_clock

MISSING = ("", "nan", "na", "n/a", "null", "none", "-nan", "1.#qnan", "inf", "-inf", "+inf", "-", "--")
NUMBER, BLANK, WATCH, WORD = "number", "blank", "clock", "word"
# Thousands set apart, as in 1,038.4: only where decimals follow, since 1,038 is as well a number with a decimal comma.
_GROUPED = {
    ".": re.compile(r"[-+]?\d{1,3}(?P<mark>[,'])\d{3}(?:(?P=mark)\d{3})*\.\d+"),
    ",": re.compile(r"[-+]?\d{1,3}(?P<mark>[.'])\d{3}(?:(?P=mark)\d{3})*,\d+"),
}
_LONGEST = 100_000  # characters of a line in which quotes are minded


def split(line: str, delimiter: str) -> list[str]:
    """Fields of a line, stripped of blanks and quotes; a delimiter between quotes does not separate."""
    if delimiter == " ":
        fields = line.split()
    elif '"' in line and len(line) < _LONGEST:
        fields = re.split(rf'{re.escape(delimiter)}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)
    else:
        fields = line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def number(field: str, decimal: str) -> float | None:
    """The value of a field, NaN where it is left out, None where it is no number."""
    if field.lower() in MISSING:
        return float("nan")
    mark = thousands_in(field, decimal)
    text = field if mark is None else field.replace(mark, "")
    text = text.replace(",", ".") if decimal == "," else text
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def thousands_in(field: str, decimal: str) -> str | None:
    """What sets thousands apart in a field, None where nothing does."""
    match = _GROUPED[decimal].fullmatch(field)
    return None if match is None else match["mark"]


def kind_of(field: str, decimal: str) -> str:
    """What a field holds: a number, a time of day, a word, or nothing."""
    value = number(field, decimal)
    if value is not None:
        return NUMBER if value == value else BLANK
    return WATCH if is_clock(field) else WORD
