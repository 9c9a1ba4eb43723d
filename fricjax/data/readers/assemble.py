"""Conversion of a file's columns to records, with units, sign and checks.

Error messages name file, column and row.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import DataError, quoted
from ..record import Record, Step
from ..units import DISPLACEMENT, TIME
from .choice import Choice
from .choose import Pair, choose, rivals, stated_rate
from .header import rate_of_change, scale_of
from .sheet import Column, Sheet

if TYPE_CHECKING:
    from ..trace import Trace

# Scatter about a circle, relative to that about a straight line, below which two coordinates lie on a circle.
_ON_CIRCLE = 0.2


def records_of(path: Path, kind: str, sheet: Sheet, choice: Choice, **of_format: Any) -> Record | list[Record]:
    """Return the record of a sheet, or a list for `run="all"`.

    Args:
        path: the file, for messages and `meta`.
        kind: the format, for `meta`.
        sheet: the columns of the file.
        choice: the common options.
        of_format: the other options, for the log.

    Raises:
        DataError: see `choose` and `assemble`.
    """
    pairs = choose(sheet, choice, path.name)
    if choice.column is None:
        for pair in pairs:
            _check_circle(sheet, pair, path)
    wanted = list(dict.fromkeys(column for pair in pairs for column in pair if column is not None))
    loaded = (np.asarray(numbers, dtype=np.float64).ravel() for numbers in sheet.load(wanted))
    values = dict(zip(wanted, loaded, strict=True))
    records, named = [], choice.column is not None
    for x, time in pairs:
        samples = Samples(x, values[x], time, None if time is None else values[time], sheet.place)
        known = dataclasses.replace(choice, rate=stated_rate(sheet)) if time is None and choice.rate is None else choice
        record = assemble(path, kind, samples, known, **of_format)
        others = [] if named else [column.name for column in rivals(sheet, x)]
        if others:
            first = dataclasses.replace(record.log[0], effect=f"{record.log[0].effect}, not {quoted(others)}")
            record = Record(record.trace, record.meta, (first, *record.log[1:]))
        records.append(record)
    return records if choice.all_runs else records[0]


def _check_circle(sheet: Sheet, pair: Pair, path: Path) -> None:
    """Refuse coordinates on a circle, as of a filmed pendulum."""
    across = [c for c in sheet.columns if c.name.lower() == "y" and c.run == pair.x.run and c.fault is None]
    if pair.x.name.lower() != "x" or not across:
        return
    x, y = (np.asarray(each, dtype=np.float64).ravel() for each in sheet.load([pair.x, across[0]]))
    used = np.isfinite(x) & np.isfinite(y) if x.size == y.size else np.zeros(0, bool)
    if np.count_nonzero(used) < 10 or np.ptp(x[used]) == 0 or np.ptp(y[used]) == 0:
        return
    x, y = x[used] - x[used].mean(), y[used] - y[used].mean()
    # Circle by linear least squares (Kasa, 1976): x^2 + y^2 = 2 a x + 2 b y + c.
    basis = np.stack([x, y, np.ones(x.size)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(basis, x**2 + y**2)
    radius = float(np.sqrt(c + (a**2 + b**2) / 4))
    off = np.std(np.hypot(x - a / 2, y - b / 2) - radius)
    straight = np.std(y - x * (x @ y) / (x @ x))
    # A mass on a spring moves on a straight line, which a circle of any size fits no better.
    if np.isfinite(radius) and off < _ON_CIRCLE * straight:
        raise DataError(
            f"'x' and 'y' of {path.name} lie on a circle of radius {radius:.4g}, as of a filmed pendulum. "
            "x = L sin(theta) is no displacement that fricjax can fit: convert it to the angle, or give column='x' to "
            "fit it as it is."
        )


class Samples(NamedTuple):
    """The numbers of one run, before the conversion of units.

    `time` and `times` are None if a rate is given; `place(i)` describes the position of sample `i` in the file
    ("row 17").
    """

    x: Column
    values: np.ndarray
    time: Column | None
    times: np.ndarray | None
    place: Callable[[int], str]


def assemble(path: Path, kind: str, samples: Samples, choice: Choice, **of_format: Any) -> Record:
    """Build the record of a run.

    Args:
        path: the file, for messages and `meta`.
        kind: the format, for `meta`.
        samples: numbers from the reader.
        choice: the common options; units there replace those of the file.
        of_format: the other options, for the log.

    Raises:
        DataError: too few samples, a missing or non-increasing time, or a unit that does not fit.
    """
    from ..trace import MINIMUM_SAMPLES, Trace

    samples = _without_blank_rows(samples)
    x, values, time = samples.x, samples.values, samples.time
    where = f"the displacement '{x.name}' of {path.name}"
    _refuse_rates_of_change(path, x, choice)
    scale, quantity = scale_of(x.unit, choice.unit, DISPLACEMENT, where, "unit")
    t, time_unit = _times(path, samples, choice)
    used = np.count_nonzero(np.isfinite(values))
    if used < MINIMUM_SAMPLES:
        raise DataError(
            f"{path.name} holds {used} usable samples in '{x.name}', but a trace needs at least {MINIMUM_SAMPLES}; "
            "check the column and the rows skipped."
        )
    sigma = None if choice.sigma is None else np.asarray(choice.sigma, dtype=np.float64) * abs(scale)
    # A long record that is already in SI units is not copied.
    factor = scale * choice.sign
    trace = Trace(t, values if factor == 1.0 else values * factor, sigma)
    unit = choice.unit or x.unit
    meta = {
        "source": path.name,
        "format": kind,
        "columns": {"t": None if time is None else time.name, "x": x.name},
        "units": {"t": time_unit, "x": unit or quantity},
        "quantity": quantity,
        "release_time": None,
        **({} if x.run is None else {"run": x.run}),
        **({} if unit else {"warnings": [_unit_missing(path, samples, choice)]}),
    }
    read = Step("read", _plain({**vars(choice), **of_format}), _effect(trace, x, unit, quantity, choice))
    return Record(trace, meta, (read,))


def _refuse_rates_of_change(path: Path, x: Column, choice: Choice) -> None:
    unit = x.unit or choice.unit
    quantity = rate_of_change(x.name, unit)
    if quantity is None:
        return
    one = "a velocity" if quantity == "velocity" else "an acceleration"
    if unit:
        raise DataError(
            f"'{x.name}' of {path.name} is {one} ({unit}), which fricjax cannot fit yet. Choose a displacement or an "
            "angle with column=, or export one."
        )
    raise DataError(
        f"'{x.name}' of {path.name} names no unit and seems to be {one}, which fricjax cannot fit yet. If it is a "
        "displacement or an angle, give its unit=."
    )


def with_choice(record: Record, choice: Choice) -> Record:
    """Apply `sigma` and `sign` to a record in the package's own format."""
    from ..trace import Trace

    if choice.sigma is None and choice.sign == 1:
        return record
    sigma = record.trace.sigma if choice.sigma is None else choice.sigma
    trace = Trace(record.trace.t, choice.sign * record.x, sigma, record.trace.mask)
    chosen = _plain({"sigma": choice.sigma, "sign": choice.sign})
    return record.with_step(Step("read", chosen, "noise or direction given by the caller"), trace=trace)


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    """Convert the options to values that JSON can store."""
    return {
        key: value.tolist() if hasattr(value, "tolist") else value
        for key, value in options.items()
        if value is not None and (key, value) != ("sign", 1)
    }


def _without_blank_rows(samples: Samples) -> Samples:
    """Remove blank rows, and blank displacements at the end.

    If runs of unequal length stand next to each other, the shorter ones end in such rows.
    """
    values, times = samples.values, samples.times
    blank = np.isnan(values)
    if not blank.any() or (times is not None and times.size != values.size):
        return samples
    filled = np.flatnonzero(~blank)
    after = np.arange(values.size) > (filled[-1] if filled.size else -1)
    kept = np.flatnonzero(~(after | (blank & np.isnan(times)) if times is not None else after))
    times = None if times is None else times[kept]
    return samples._replace(values=values[kept], times=times, place=lambda i: samples.place(int(kept[i])))


def _unit_missing(path: Path, samples: Samples, choice: Choice) -> str:
    """Return a warning about the assumed unit of a column."""
    time = samples.time
    times, also = "", ""
    if time is not None and time.unit is None and choice.time_unit is None:
        times, also = f", '{time.name}' as s", " and time_unit="
    named = f"{path.name} names no unit for '{samples.x.name}'"
    return f"{named}: it is taken as m{times}. If that is not so, give unit={also}."


def _times(path: Path, samples: Samples, choice: Choice) -> tuple[np.ndarray, str]:
    size, time, t = samples.values.size, samples.time, samples.times
    if time is None or t is None:
        # `choose` has refused a sheet with neither times nor a rate.
        assert choice.rate is not None
        return np.arange(size) / float(choice.rate), "s"
    if t.size != size:
        raise DataError(
            f"In {path.name} '{time.name}' has {t.size} samples and '{samples.x.name}' has {size}; choose columns of "
            "one length with time= and column=."
        )
    scale, _ = scale_of(time.unit, choice.time_unit, TIME, f"the time '{time.name}' of {path.name}", "time_unit")
    _check_times(f"{path.name}, column '{time.name}'", t, samples.place)
    return t if scale == 1.0 else t * scale, choice.time_unit or time.unit or "s"


def _check_times(where: str, t: np.ndarray, place: Callable[[int], str]) -> None:
    from ..trace import first_not_later

    remedy = "repair or drop that row, choose another column with time=, or give rate= instead."
    finite = np.isfinite(t)
    if not finite.all():
        i = int(np.argmin(finite))
        raise DataError(f"{where}, {place(i)}: the time is {t[i]} (NaN, infinite or missing); {remedy}")
    i = first_not_later(t)
    if i is not None:
        if i > 1 and t[i] <= t[0]:
            remedy = "it starts again there, as if a second run followed: write each run to a separate file."
        raise DataError(
            f"{where}, {place(i)}: the time is not increasing ({float(t[i])} after {float(t[i - 1])}); {remedy}"
        )


def _effect(trace: "Trace", x: Column, unit: str | None, quantity: str, choice: Choice) -> str:
    parts = [f"{trace.n} samples of '{x.name}'"]
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
