"""From the numbers of a file to a record: units, sign, gaps, and the checks that name file, column and row."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import DataError, UsageError
from .record import Record, Step
from .units import DISPLACEMENT, TIME, factor

if TYPE_CHECKING:
    from .trace import Trace


@dataclasses.dataclass(frozen=True)
class Choice:
    """What the caller chose for any format: see `fricjax.read`."""

    column: Any = None
    time: Any = None
    unit: str | None = None
    time_unit: str | None = None
    rate: float | None = None
    sigma: Any = None
    sign: int = 1

    def __post_init__(self) -> None:
        if self.rate is not None and not (np.isfinite(self.rate) and self.rate > 0):
            raise UsageError(f"rate must be a positive number of samples per second, but it is {self.rate}.")
        if self.rate is not None and self.time is not None:
            raise UsageError("Give either time= (a column of times) or rate= (samples per second), not both.")
        if self.sign not in (1, -1):
            raise UsageError(f"sign must be 1 or -1, but it is {self.sign}.")

    @property
    def takes_all(self) -> bool:
        """Whether nothing is said about columns and units, so that a record of the package itself comes back whole."""
        return all(value is None for value in (self.column, self.time, self.unit, self.time_unit, self.rate))

    def applied(self, record: Record) -> Record:
        """A restored record with the noise and the direction chosen here."""
        if self.sigma is None and self.sign == 1:
            return record
        from .trace import Trace

        old = record.trace
        sigma = old.sigma if self.sigma is None else self.sigma
        chosen = {"sigma": self.sigma, "sign": self.sign}
        trace = Trace(old.t, self.sign * np.asarray(old.x), sigma, old.mask)
        return record.with_step(Step("read", _plain(chosen), "noise or direction given by the caller"), trace=trace)


@dataclasses.dataclass(frozen=True)
class Columns:
    """The two columns as a reader found them, before units.

    `place(i)` words where sample `i` stands in the file ("row 17"); `time` is None where there is only a rate.
    """

    x: np.ndarray
    time: np.ndarray | None
    x_name: str
    time_name: str = "time"
    x_unit: str | None = None
    time_unit: str | None = None
    place: Callable[[int], str] = lambda i: f"sample {i + 1}"


def assemble(path: Path, kind: str, columns: Columns, choice: Choice, options: dict[str, Any]) -> Record:
    """Builds the record of a file.

    Args:
        path: the file, named in messages and in `meta`.
        kind: the format, for `meta`.
        columns: what the reader found.
        choice: the common options; units given there replace those of the file.
        options: all options given, for the log.

    Raises:
        DataError: too few samples, a time that is missing or does not increase, a unit that does not fit.
    """
    from .trace import MINIMUM_SAMPLES, Trace

    x = np.asarray(columns.x, dtype=np.float64).ravel()
    unit = choice.unit or columns.x_unit
    scale, quantity = factor(unit or "m", DISPLACEMENT, f"the displacement '{columns.x_name}' of {path.name}")
    t, time_unit = _times(path, x.size, columns, choice)
    used = np.isfinite(x)
    if used.sum() < MINIMUM_SAMPLES:
        raise DataError(
            f"{path.name} holds {int(used.sum())} usable samples in '{columns.x_name}', but a trace needs at least "
            f"{MINIMUM_SAMPLES}; check the column and the rows skipped."
        )
    sigma = None if choice.sigma is None else np.asarray(choice.sigma, dtype=np.float64) * scale
    trace = Trace(t, x * (scale * choice.sign), sigma, used)
    meta = {
        "source": path.name,
        "format": kind,
        "columns": {"t": columns.time_name if choice.rate is None else None, "x": columns.x_name},
        "units": {"t": time_unit, "x": unit or "m"},
        "quantity": quantity,
        "release_time": None,
    }
    return Record(trace, meta, (Step("read", _plain(options), _effect(trace, columns, unit, quantity, choice)),))


def _times(path: Path, size: int, columns: Columns, choice: Choice) -> tuple[np.ndarray, str]:
    if choice.rate is not None:
        return np.arange(size) / float(choice.rate), "s"
    if columns.time is None:
        raise DataError(
            f"{path.name} has one column ('{columns.x_name}') and no time; give rate= (samples per second) or time=."
        )
    t = np.asarray(columns.time, dtype=np.float64).ravel()
    if t.size != size:
        raise DataError(
            f"In {path.name} '{columns.time_name}' has {t.size} samples and '{columns.x_name}' has {size}; choose "
            "columns of one length with time= and column=."
        )
    unit = choice.time_unit or columns.time_unit or "s"
    _check_times(path, t, columns)
    return t * factor(unit, TIME, f"the time '{columns.time_name}' of {path.name}")[0], unit


def _check_times(path: Path, t: np.ndarray, columns: Columns) -> None:
    remedy = "repair or drop that row, choose another column with time=, or give rate= instead."
    missing = np.flatnonzero(~np.isfinite(t))
    if missing.size:
        i = int(missing[0])
        raise DataError(
            f"{path.name}, column '{columns.time_name}', {columns.place(i)}: the time is {t[i]} (NaN, infinite or "
            f"missing); {remedy}"
        )
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        i = int(back[0]) + 1
        raise DataError(
            f"{path.name}, column '{columns.time_name}', {columns.place(i)}: the time is not increasing "
            f"({float(t[i])} after {float(t[i - 1])}); {remedy}"
        )


def _effect(trace: "Trace", columns: Columns, unit: str | None, quantity: str, choice: Choice) -> str:
    parts = [f"{trace.n} samples of '{columns.x_name}'"]
    parts.append(f"in {unit}" if unit else "no unit found or given, taken as m")
    if choice.unit and columns.x_unit and choice.unit != columns.x_unit:
        parts.append(f"although the file says {columns.x_unit}")
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


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    """The options as JSON can hold them."""
    return {
        key: value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
        for key, value in options.items()
        if value is not None and (key, value) != ("sign", 1)
    }
