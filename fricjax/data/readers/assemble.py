"""Conversion of a file's columns to records, with units, sign and checks.

Error messages name file, column and row.
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import DataError, quoted
from ..observation import Observation
from ..record import Record, Step
from ..units import READING, TIME, gravity
from .choice import Choice
from .choose import Samples, samples_of
from .header import rate_of_change, scale_of
from .sheet import Column, Sheet

if TYPE_CHECKING:
    from ..trace import Trace


# Words for a column without a unit, and the options that name one.
_RATES = {
    "velocity": ("a velocity", "unit='rad/s', unit='deg/s' or unit='m/s'"),
    "acceleration": ("an acceleration", "unit='m/s^2', unit='g' or unit='rad/s^2'"),
}


def records_of(path: Path, kind: str, sheet: Sheet, choice: Choice, **of_format: Any) -> Record | list[Record]:
    """Return the record of a sheet, or a list for `run="all"`.

    Args:
        path: the file, for messages and `meta`.
        kind: the format, for `meta`.
        sheet: the columns of the file.
        choice: the common options.
        of_format: the other options, for the log.

    Raises:
        DataError: see `samples_of`; also too few samples, a missing or non-increasing time, or a unit that does not
            fit.
    """
    return assemble_all(path, kind, samples_of(sheet, choice, path.name), choice, **of_format)


def assemble_all(
    path: Path, kind: str, runs: Sequence[Samples], choice: Choice, **of_format: Any
) -> Record | list[Record]:
    """Return the record, or a list for `run="all"`."""
    records = [assemble(path, kind, samples, choice, **of_format) for samples in runs]
    return records if choice.all_runs else records[0]


def assemble(path: Path, kind: str, samples: Samples, choice: Choice, **of_format: Any) -> Record:
    """Build the record of a run; arguments as in `records_of`.

    Units in the options replace those of the file.
    """
    from ..trace import MINIMUM_SAMPLES, Trace

    samples = _without_blank_rows(samples)
    if samples.time is None and choice.rate is None:
        choice = dataclasses.replace(choice, rate=samples.rate)
    x, values, time = samples.x, samples.values, samples.time
    where = f"the displacement '{x.name}' of {path.name}"
    _refuse_without_unit(path, x, choice)
    titled = gravity(x.unit) if rate_of_change(x.name, x.unit) == "acceleration" else x.unit
    scale, quantity = scale_of(titled, gravity(choice.unit), READING, where, "unit")
    observed = _projected(choice, quantity, where)
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
        **observed,
        "release_time": None,
        **({} if x.run is None else {"run": x.run}),
        **({} if unit else {"warnings": [_unit_missing(path, samples, choice)]}),
    }
    read = Step("read", _plain({**vars(choice), **of_format}), _effect(trace, samples, unit, quantity, choice))
    return Record(trace, meta, (read,))


def _refuse_without_unit(path: Path, x: Column, choice: Choice) -> None:
    """Refuse a velocity or an acceleration without a unit."""
    kind = None if x.unit or choice.unit else rate_of_change(x.name, None)
    if kind is not None:
        one, units = _RATES[kind]
        raise DataError(
            f"'{x.name}' of {path.name} names no unit and seems to be {one}. Give its unit, such as {units}. If it is "
            "a displacement or an angle, give that unit."
        )


def _projected(choice: Choice, quantity: str, where: str) -> dict[str, Any]:
    """Return the metadata of a filmed pendulum, if its length is given."""
    if choice.pendulum_length is None:
        return {}
    if quantity != "m":
        raise DataError(f"pendulum_length= needs a position in m, mm or pixels, but {where} is in {quantity}.")
    return Observation("projection", length=choice.length).meta


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


def _effect(trace: "Trace", samples: Samples, unit: str | None, quantity: str, choice: Choice) -> str:
    parts = [f"{trace.n} samples of '{samples.x.name}'", f"in {unit}" if unit else "no unit found or given, taken as m"]
    if unit not in (None, quantity):
        parts.append(f"converted to {quantity}")
    if choice.rate is not None:
        parts.append(f"times from the rate of {choice.rate:g} per second")
    missing = ~np.asarray(trace.mask)
    if missing.any():
        starts = int(missing[0]) + int(np.count_nonzero(np.diff(missing.astype(int)) == 1))
        gaps = "gap" if starts == 1 else "gaps"
        parts.append(f"{int(missing.sum())} samples without a value masked in {starts} {gaps}")
    if samples.others:
        parts.append(f"not {quoted(samples.others)}")
    return ", ".join(parts)
