"""Selection of displacement and time columns by name, number, run or convention.

The numbers of the chosen columns are loaded here, but not converted.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...errors import DataError, UsageError, nearest, quoted
from ...show import Table
from .choice import Choice
from .header import TIME_WORDS, UNSCALED, first_word, measures, names_rate, rate_of_change
from .sheet import SINGLE, Column, Sheet, folder_of

# Names that identify the displacement even if other columns could be one.
_PLAINEST = ("x", "displacement")
_DISPLACEMENT_WORDS = frozenset((
    "x", "y", "q", "displacement", "position", "pos", "disp", "distance", "deflection", "elongation", "theta", "angle",
    "phi", "weg", "auslenkung", "winkel", "deplacement", "déplacement", "angolo", "posizione",
))  # fmt: skip
# Names or units of columns that count the rows.
_COUNTERS = frozenset((
    "index", "sample", "samples", "n", "no", "no.", "nr", "nr.", "row", "point", "points", "number", "sequence", "i",
    "k", "frame", "step", "#", "",
))  # fmt: skip
_LISTED = 20  # largest number of runs in a table of runs
# Scatter about a circle, relative to that about a straight line, below which two coordinates lie on a circle.
_ON_CIRCLE = 0.2
_NUMBERED = re.compile(r"(?P<base>.*?[^\d_ ])[_ ]?(?P<number>\d{1,4})")


class Samples(NamedTuple):
    """The numbers of one run, before the conversion of units.

    `time` and `times` are None if a rate is given; `place(i)` describes the position of sample `i` in the file
    ("row 17"). `rate` is the sample rate in the file [Hz] if there are no times. `others` are the names of other
    columns that may be displacements.
    """

    x: Column
    values: np.ndarray
    time: Column | None
    times: np.ndarray | None
    place: Callable[[int], str]
    rate: float | None = None
    others: tuple[str, ...] = ()


def samples_of(sheet: Sheet, choice: Choice, source: str) -> list[Samples]:
    """Select displacement and times of each run and load their numbers.

    Messages refer to the file as `source`.

    Raises:
        DataError: no numbers, an unknown column or run, several runs without a choice, several columns that could be
            the displacement, or the coordinates of a filmed pendulum.
    """
    if sheet.of and not any(column.fault is None for column in sheet.columns):
        raise DataError(f"{source} holds no {sheet.of} of numbers that could be a record.")
    by_run = _with_numbered_runs(sheet)
    runs: list[str | None] = list(by_run.runs)
    if choice.run is not None and not runs and not choice.all_runs:
        raise DataError(f"{source} holds one run only, but run={choice.run!r} was given; leave run= out.")
    if choice.run is None and len(runs) > 1:
        if choice.column is None or len(_matches(choice.column, by_run.columns)) > 1:
            raise DataError(_question(by_run, choice, source))
        runs = [_locate(choice.column, by_run.columns, source, "column").run]
    elif choice.run is not None and not choice.all_runs:
        runs = [_run(choice.run, by_run.runs, source)]
    pairs = [_pair(by_run, run, choice, source) for run in runs or [None]]
    if choice.column is None and choice.pendulum_length is None:
        for x, _ in pairs:
            _check_circle(sheet, x, source)
    wanted = list(dict.fromkeys(column for pair in pairs for column in pair if column is not None))
    loaded = (np.asarray(numbers, dtype=np.float64).ravel() for numbers in sheet.load(wanted))
    values = dict(zip(wanted, loaded, strict=True))
    samples = []
    for x, time in pairs:
        others = () if choice.column is not None else tuple(column.name for column in _rivals(sheet, x))
        rate = _stated_rate(sheet) if time is None else None
        times = None if time is None else values[time]
        samples.append(Samples(x, values[x], time, times, sheet.place, rate, others))
    return samples


def _stated_rate(sheet: Sheet) -> float | None:
    """Return the sample rate in the file [Hz], None if unknown."""
    single = [column for column in sheet.columns if column.fault == SINGLE and names_rate(column.name)]
    if sheet.rate is not None or not single:
        return sheet.rate
    rate = float(np.ravel(sheet.load(single[:1])[0])[0])
    return rate if np.isfinite(rate) and rate > 0 else None


def _rivals(sheet: Sheet, x: Column) -> list[Column]:
    """Return the other columns of the run that may be displacements."""
    return [
        column
        for column in sheet.columns
        if column is not x and column.run == x.run and column.fault is None and not column.bare and _is_usual(column)
    ]


def _check_circle(sheet: Sheet, x: Column, source: str) -> None:
    """Refuse coordinates on a circle, as of a filmed pendulum."""
    across = [c for c in sheet.columns if c.name.lower() == "y" and c.run == x.run and c.fault is None]
    if x.name.lower() != "x" or not across:
        return
    first, second = (np.asarray(each, dtype=np.float64).ravel() for each in sheet.load([x, across[0]]))
    used = np.isfinite(first) & np.isfinite(second) if first.size == second.size else np.zeros(0, bool)
    if np.count_nonzero(used) < 10 or np.ptp(first[used]) == 0 or np.ptp(second[used]) == 0:
        return
    x0, y0 = first[used] - first[used].mean(), second[used] - second[used].mean()
    # Circle by linear least squares (Kasa, 1976): x^2 + y^2 = 2 a x + 2 b y + c.
    basis = np.stack([x0, y0, np.ones(x0.size)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(basis, x0**2 + y0**2)
    radius = float(np.sqrt(c + (a**2 + b**2) / 4))
    off = np.std(np.hypot(x0 - a / 2, y0 - b / 2) - radius)
    straight = np.std(y0 - x0 * (x0 @ y0) / (x0 @ x0))
    # A mass on a spring moves on a straight line, which a circle of any size fits no better.
    if np.isfinite(radius) and off < _ON_CIRCLE * straight:
        raise DataError(
            f"'x' and 'y' of {source} lie on a circle of radius {radius:.4g}, as of a filmed pendulum. "
            "Then x = L sin(theta) is no displacement: give the length of the pendulum, pendulum_length='0.42 m', to "
            "fit its angle, or column='x' to fit x as it is."
        )


def _locate(wanted: str | int, columns: Sequence[Column], source: str, option: str) -> Column:
    """Find a column by name or number."""
    if isinstance(wanted, bool) or not isinstance(wanted, (str, int)):
        raise UsageError(f"{option}= must be a name or an index of a column, but it is {wanted!r}.")
    matches = _matches(wanted, columns)
    if len(matches) == 1:
        return matches[0]
    names = _labels(columns)
    if matches:
        places = " or ".join(f"{option}={i}" for i, column in enumerate(columns) if column in matches)
        raise DataError(f"{source} has {len(matches)} columns '{wanted}'; choose one by its number, {places}.")
    if _is_number(wanted):
        raise DataError(f"{source} has {len(names)} columns, but {option}={wanted} was given (the first is 0).")
    raise DataError(
        f"{source} has no column '{str(wanted)[:80]}' (given by {option}=).{nearest(wanted, names)} It has "
        f"{quoted(names)}."
    )


def _labels(columns: Sequence[Column]) -> list[str]:
    """Return the names of columns, or the full titles of equal names."""
    names = [column.name for column in columns]
    return [name if names.count(name) == 1 else column.shown for name, column in zip(names, columns, strict=True)]


def _is_number(wanted: str | int) -> bool:
    return isinstance(wanted, int) or re.fullmatch(r"-?\d{1,9}", wanted) is not None


def _matches(wanted: str | int, columns: Sequence[Column]) -> list[Column]:
    """Return the columns with this title, name or number.

    The order of preference is: title, name, title or name in any case, number.
    """
    text = str(wanted).strip()
    for alike in (
        lambda column: text in (column.shown, column.name.lstrip("/")),
        lambda column: text == column.name,
        lambda column: text.lower() in (column.shown.lower(), column.name.lower()),
    ):
        matches = [column for column in columns if alike(column)]
        if matches:
            return matches
    if _is_number(wanted) and -len(columns) <= int(wanted) < len(columns):
        return [columns[int(wanted)]]
    return []


def _with_numbered_runs(sheet: Sheet) -> Sheet:
    """Split columns such as `t1, x1, t2, x2` into numbered runs.

    The names must differ by a number, and each number needs a time.
    """
    if sheet.runs:
        return sheet
    numbered = [(column, None if column.bare else _NUMBERED.fullmatch(column.name)) for column in sheet.columns]
    numbers = {match["number"] for _, match in numbered if match}
    times = {
        match["number"]
        for column, match in numbered
        if match and replace(column, name=match["base"].rstrip("_ ")).is_time
    }
    if len(numbers) < 2 or numbers != times:
        return sheet
    columns = [replace(column, run=f"Run {match['number']}") if match else column for column, match in numbered]
    return replace(sheet, columns=columns)


def _run(wanted: str | int, runs: list[str], source: str) -> str:
    """Find a run by label, by number, or by position from 1."""
    text = str(wanted).strip().lower().lstrip("#")
    for alike in (lambda run: run.lower() == text, lambda run: re.findall(r"\d+", run)[-1:] == [text]):
        matches = [run for run in runs if alike(run)]
        if len(matches) == 1:
            return matches[0]
    if text.isdecimal() and 1 <= int(text[:9]) <= len(runs):
        return runs[int(text[:9]) - 1]
    raise DataError(
        f"{source} has no run {str(wanted)[:80]!r}.{nearest(text, runs)} Its runs are {quoted(runs)}; or run='all'."
    )


def _question(sheet: Sheet, choice: Choice, source: str) -> str:
    """Return a message about a missing choice, with a table of runs."""
    rows = []
    for run in sheet.runs[:_LISTED]:
        try:
            x, time = _pair(sheet, run, choice, source)
            values, *times = sheet.load([x] if time is None else [x, time])
            used = np.flatnonzero(~np.isnan(values))
            span = f"{times[0][used[-1]] - times[0][used[0]]:.4g}" if times and used.size else "-"
            rows.append([run, x.name, str(used.size), f"{span} {(time and time.unit) or 's'}", x.unit or "not found"])
        except DataError:
            of_run = [column.name for column in sheet.columns if column.run == run and column.fault is None]
            rows.append([run, quoted(of_run, 3), "-", "-", "-"])
    table = Table(["Run", "Displacement", "Samples", "Duration", "Unit"], rows).text()
    more = f"\n... and {len(sheet.runs) - _LISTED} more" if len(sheet.runs) > _LISTED else ""
    first = re.findall(r"\d+", sheet.runs[0])[-1:] or [sheet.runs[0]]
    return f"{source} holds {len(sheet.runs)} runs; choose one with run={first[0]}, or run='all'.\n{table}{more}"


def _pair(sheet: Sheet, run: str | None, choice: Choice, source: str) -> tuple[Column, Column | None]:
    """Select displacement and time of a run.

    Columns without a run are shared by all runs.
    """
    columns = [column for column in sheet.columns if column.run in (run, None)]

    def named(wanted: str | int, option: str) -> Column:
        # A number counts the columns of the file, whichever run they belong to.
        return _locate(wanted, sheet.columns if _is_number(wanted) else columns, source, option)

    named_time = None if choice.time is None else named(choice.time, "time")
    if choice.column is not None:
        x = named(choice.column, "column")
    else:
        x = _displacement([column for column in columns if column is not named_time], choice, source)
    if x.fault is not None:
        raise DataError(f"'{x.shown}' in {source} {x.fault}, so it is no displacement; name another with column=.")
    time = None if choice.rate is not None else named_time or x.time or _time(columns, x, source, _stated_rate(sheet))
    if time is not None and time.fault is not None:
        raise DataError(
            f"'{time.shown}' in {source} {time.fault}, so it is no time; name another with time=, or give rate=."
        )
    return x, time


def _time(columns: Sequence[Column], x: Column, source: str, rate: float | None) -> Column | None:
    """Select the time of x, None if the file states a rate.

    A time of the same run and folder is preferred to a time of the file, and a number of seconds to a time of day.
    Without names, the first column is the time.
    """
    usable = [column for column in columns if column is not x and column.fault is None]
    times = [column for column in usable if column.is_time]
    folder = folder_of(x.name)
    near = [column for column in times if column.run == x.run and folder_of(column.name) == folder]
    for among in (near, [column for column in times if column.run == x.run], times):
        if among:
            # Prefer a title that is just a name of a time, then one with a unit of time.
            rank = lambda column: (column.clock, column.last.lower() not in TIME_WORDS, measures(column.unit) != "s")
            return min(among, key=rank)
    if usable and all(column.bare for column in columns) and columns.index(usable[0]) < columns.index(x):
        return usable[0]
    if rate is not None:
        return None
    others = f"; its columns are {quoted(_labels(columns))}" if len(columns) > 1 else ""
    scale = f", and a scale for its {x.unit}, as unit='12.5 mm/{x.unit}'" if (x.unit or "").lower() in UNSCALED else ""
    raise DataError(
        f"{source} has no time for '{x.name}'{others}; give rate= (samples per second) or time= (a column){scale}."
    )


def _displacement(columns: Sequence[Column], choice: Choice, source: str) -> Column:
    """Select the displacement by name, by unit, or as the only candidate."""
    bare = all(column.bare for column in columns)
    usable = [column for column in columns if column.fault is None]
    if bare and choice.rate is None and choice.time is None and len(usable) > 1:
        usable = usable[1:]  # without names the first column is the time
    counts_rows = lambda column: not _COUNTERS.isdisjoint((column.name.lower(), (column.unit or "-").lower()))
    candidates = [
        column
        for column in columns
        if not column.is_time and (column in usable if bare else column.bare or not counts_rows(column))
    ]
    candidates = _without_rates(candidates)
    if not candidates:
        names = quoted(_labels(columns))
        raise DataError(f"{source} holds no displacement, only {names or 'no columns'}; name one with column=.")
    for among in ([c for c in candidates if not folder_of(c.name)], candidates):
        named = [column for column in among if _is_usual(column)]
        plainest = [column for column in named if column.name.lower() in _PLAINEST]
        if len(named) == 1 or len(plainest) == 1:
            return plainest[0] if len(plainest) == 1 else named[0]
        if named:
            candidates = named
            break
    for fits in (
        lambda column: column.fault is None and measures(column.unit) in ("m", "rad"),
        lambda column: column.fault is None and measures(column.unit) is None,
        lambda column: column.fault is None,
        lambda column: True,
    ):
        fitting = [column for column in candidates if fits(column)]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            candidates = fitting
            break
    names = quoted(_labels(candidates))
    raise DataError(f"{source} has several columns that could be the displacement ({names}); name one with column=.")


def _without_rates(columns: list[Column]) -> list[Column]:
    """Prefer displacements to their rates, and rates to other units."""
    rates = [column for column in columns if rate_of_change(column.last, column.unit) is not None]
    others = [column for column in columns if column not in rates]
    usable = any(column.fault is None and measures(column.unit) in (None, "m", "rad") for column in others)
    known = [column for column in rates if column.fault is None]
    return known if known and not usable else others or columns


def _is_usual(column: Column) -> bool:
    last, kind = column.last.lower(), measures(column.unit)
    return (last in _DISPLACEMENT_WORDS or first_word(last) in _DISPLACEMENT_WORDS) and kind in (None, "m", "rad")
