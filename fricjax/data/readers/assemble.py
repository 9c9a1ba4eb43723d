"""From the columns of a file to its records: units, sign, gaps, and the checks that name file, column and row."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import DataError
from ..record import Record, Step
from ..units import DISPLACEMENT, TIME
from .choice import Choice
from .choose import choose
from .header import scale_of
from .sheet import Sheet

if TYPE_CHECKING:
    from ..trace import Trace


def records_of(path: Path, kind: str, sheet: Sheet, choice: Choice, options: dict[str, Any]) -> Record | list[Record]:
    """The record of a sheet, or those of all its runs where the caller asks for `run="all"`.

    Args:
        path: the file, named in messages and in `meta`.
        kind: the format, for `meta`.
        sheet: its columns.
        choice: the common options.
        options: all options, for the log.

    Raises:
        DataError: as `choose` and `assemble` do.
    """
    pairs = choose(sheet, choice, path.name)
    wanted = list(dict.fromkeys(column for pair in pairs for column in pair if column is not None))
    values = dict(zip(wanted, sheet.load(wanted), strict=True))
    records = []
    for x, time in pairs:
        columns = Columns(values[x], None, x.name, x_unit=x.unit, run=x.run, place=sheet.place)
        if time is not None:
            times = {"time": values[time], "time_name": time.name, "time_unit": time.unit}
            columns = dataclasses.replace(columns, **times)
        records.append(assemble(path, kind, columns, choice, options))
    return records if choice.all_runs else records[0]


@dataclasses.dataclass(frozen=True)
class Columns:
    """The two columns as a reader returns them, before units.

    `place(i)` words where sample `i` stands in the file ("row 17"); `time` is None where there is only a rate,
    `run` the label of the run where the file holds several.
    """

    x: np.ndarray
    time: np.ndarray | None
    x_name: str
    time_name: str = "time"
    x_unit: str | None = None
    time_unit: str | None = None
    run: str | None = None
    place: Callable[[int], str] = lambda i: f"sample {i + 1}"


def assemble(path: Path, kind: str, columns: Columns, choice: Choice, options: dict[str, Any]) -> Record:
    """Builds the record of a file.

    Args:
        path: the file, named in messages and in `meta`.
        kind: the format, for `meta`.
        columns: what the reader returned.
        choice: the common options; units there replace those of the file.
        options: all options, for the log.

    Raises:
        DataError: too few samples, a time that is missing or does not increase, a unit that does not fit.
    """
    from ..trace import MINIMUM_SAMPLES, Trace

    columns = _without_blank_rows(columns)
    x = np.asarray(columns.x, dtype=np.float64).ravel()
    where = f"the displacement '{columns.x_name}' of {path.name}"
    scale, quantity = scale_of(columns.x_unit, choice.unit, DISPLACEMENT, where, "unit")
    t, time_unit = _times(path, x.size, columns, choice)
    used = np.count_nonzero(np.isfinite(x))
    if used < MINIMUM_SAMPLES:
        raise DataError(
            f"{path.name} holds {used} usable samples in '{columns.x_name}', but a trace needs at least "
            f"{MINIMUM_SAMPLES}; check the column and the rows skipped."
        )
    sigma = None if choice.sigma is None else np.asarray(choice.sigma, dtype=np.float64) * abs(scale)
    # A long record that is in SI units already is not copied.
    factor = scale * choice.sign
    trace = Trace(t, x if factor == 1.0 else x * factor, sigma)
    unit = choice.unit or columns.x_unit
    meta = {
        "source": path.name,
        "format": kind,
        "columns": {"t": columns.time_name if choice.rate is None else None, "x": columns.x_name},
        "units": {"t": time_unit, "x": unit or quantity},
        "quantity": quantity,
        "release_time": None,
        **({} if columns.run is None else {"run": columns.run}),
        **({} if unit else {"warnings": [_unit_missing(path, columns, choice)]}),
    }
    return Record(trace, meta, (Step("read", _plain(options), _effect(trace, columns, unit, quantity, choice)),))


def with_choice(record: Record, choice: Choice) -> Record:
    """A record of the package itself with the noise and the direction that the caller chose."""
    from ..trace import Trace

    if choice.sigma is None and choice.sign == 1:
        return record
    sigma = record.trace.sigma if choice.sigma is None else choice.sigma
    trace = Trace(record.trace.t, choice.sign * record.x, sigma, record.trace.mask)
    chosen = _plain({"sigma": choice.sigma, "sign": choice.sign})
    return record.with_step(Step("read", chosen, "noise or direction given by the caller"), trace=trace)


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    """The options as JSON can hold them."""
    return {
        key: value.tolist() if hasattr(value, "tolist") else value
        for key, value in options.items()
        if value is not None and (key, value) != ("sign", 1)
    }


def _without_blank_rows(columns: Columns) -> Columns:
    """The columns without rows that hold neither value nor time, and without blank displacements at their end.

    Where runs of unequal length stand side by side, the shorter ones end in such rows.
    """
    x = np.asarray(columns.x, dtype=np.float64).ravel()
    time = None if columns.time is None else np.asarray(columns.time, dtype=np.float64).ravel()
    blank = np.isnan(x)
    if not blank.any() or (time is not None and time.size != x.size):
        return columns
    filled = np.flatnonzero(~blank)
    after = np.arange(x.size) > (filled[-1] if filled.size else -1)
    kept = np.flatnonzero(~(after | (blank & np.isnan(time)) if time is not None else after))
    place = columns.place
    times = None if time is None else time[kept]
    return dataclasses.replace(columns, x=x[kept], time=times, place=lambda i: place(int(kept[i])))


def _unit_missing(path: Path, columns: Columns, choice: Choice) -> str:
    """What is assumed where a title names no unit."""
    bare_time = choice.rate is None and columns.time_unit is None and choice.time_unit is None
    times = f", '{columns.time_name}' as s" if bare_time else ""
    also = " and time_unit=" if bare_time else ""
    named = f"{path.name} names no unit for '{columns.x_name}'"
    return f"{named}: it is taken as m{times}. If that is not so, give unit={also}."


def _times(path: Path, size: int, columns: Columns, choice: Choice) -> tuple[np.ndarray, str]:
    if choice.rate is not None:
        return np.arange(size) / float(choice.rate), "s"
    if columns.time is None:
        raise DataError(
            f"{path.name} has no time for '{columns.x_name}'; give rate= (samples per second) or time= (a column)."
        )
    t = np.asarray(columns.time, dtype=np.float64).ravel()
    if t.size != size:
        raise DataError(
            f"In {path.name} '{columns.time_name}' has {t.size} samples and '{columns.x_name}' has {size}; choose "
            "columns of one length with time= and column=."
        )
    where = f"the time '{columns.time_name}' of {path.name}"
    scale, _ = scale_of(columns.time_unit, choice.time_unit, TIME, where, "time_unit")
    _check_times(path, t, columns)
    return t if scale == 1.0 else t * scale, choice.time_unit or columns.time_unit or "s"


def _check_times(path: Path, t: np.ndarray, columns: Columns) -> None:
    from ..trace import first_not_later

    remedy = "repair or drop that row, choose another column with time=, or give rate= instead."
    finite = np.isfinite(t)
    if not finite.all():
        i = int(np.argmin(finite))
        raise DataError(
            f"{path.name}, column '{columns.time_name}', {columns.place(i)}: the time is {t[i]} (NaN, infinite or "
            f"missing); {remedy}"
        )
    i = first_not_later(t)
    if i is not None:
        raise DataError(
            f"{path.name}, column '{columns.time_name}', {columns.place(i)}: the time is not increasing "
            f"({float(t[i])} after {float(t[i - 1])}); {remedy}"
        )


def _effect(trace: "Trace", columns: Columns, unit: str | None, quantity: str, choice: Choice) -> str:
    parts = [f"{trace.n} samples of '{columns.x_name}'"]
    parts.append(f"in {unit}" if unit else "no unit found or given, taken as m")
    if unit not in (None, quantity):
        parts.append(f"converted to {quantity}")
    if choice.rate is not None:
        parts.append(f"times from the rate of {choice.rate:g} per second")
    missing = ~np.asarray(trace.mask)
    if missing.any():
        starts = int(missing[0]) + int(np.count_nonzero(np.diff(missing.astype(int)) == 1))
        gaps = "gap" if starts == 1 else "gaps"
        parts.append(f"{int(missing.sum())} samples without a value masked in {starts} {gaps}")
    return ", ".join(parts)
