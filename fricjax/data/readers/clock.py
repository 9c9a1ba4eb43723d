"""Times of day as loggers write them: `14:23:10.0002`, `2024-03-05 14:23:10,5`, `2:05:01 PM`, `01:02.5`."""

import re
from collections.abc import Iterable

import numpy as np

CLOCK = re.compile(
    r"(?:(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})[T ]\s*)?"
    r"(?P<hours>\d{1,2}):(?P<minutes>\d{1,2})(?::(?P<seconds>\d{1,2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?Z?"
    r"|(?P<m>\d{1,3}):(?P<s>\d{1,2}[.,]\d+)"
)
_DAY = 86400.0


def is_clock(field: str) -> bool:
    """Whether a field is a time of day, with or without its date."""
    return len(field) < 40 and CLOCK.fullmatch(field) is not None


def seconds_of(fields: Iterable[object]) -> np.ndarray:
    """Seconds since the midnight before the first one, shape (rows,); NaN where there is no time of day.

    The date is not read: a decay that passes midnight goes on counting, and none lasts half a day.
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
    whole = re.sub(r"[,:]", ".", match["seconds"] or "0")
    hours = int(match["hours"])
    if match["half"]:
        hours = hours % 12 + (12 if match["half"][0] in "pP" else 0)
    return 3600.0 * hours + 60.0 * int(match["minutes"]) + float(whole)
