"""The chosen columns of a file with their numbers, before any conversion."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...errors import DataError
from .choice import Choice
from .choose import Pair, choose, rivals, stated_rate
from .sheet import Column, Sheet

# Scatter about a circle, relative to that about a straight line, below which two coordinates lie on a circle.
_ON_CIRCLE = 0.2


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
    """Choose displacement and times of each run and load their numbers.

    Args:
        sheet: the columns of the file.
        choice: the common options.
        source: name of the file, for messages.

    Raises:
        DataError: see `choose`; also for the coordinates of a filmed pendulum.
    """
    pairs = choose(sheet, choice, source)
    if choice.column is None:
        for pair in pairs:
            _check_circle(sheet, pair, source)
    wanted = list(dict.fromkeys(column for pair in pairs for column in pair if column is not None))
    loaded = (np.asarray(numbers, dtype=np.float64).ravel() for numbers in sheet.load(wanted))
    values = dict(zip(wanted, loaded, strict=True))
    runs = []
    for x, time in pairs:
        others = () if choice.column is not None else tuple(column.name for column in rivals(sheet, x))
        rate = stated_rate(sheet) if time is None else None
        runs.append(Samples(x, values[x], time, None if time is None else values[time], sheet.place, rate, others))
    return runs


def _check_circle(sheet: Sheet, pair: Pair, source: str) -> None:
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
            f"'x' and 'y' of {source} lie on a circle of radius {radius:.4g}, as of a filmed pendulum. "
            "x = L sin(theta) is no displacement that fricjax can fit: convert it to the angle, or give column='x' to "
            "fit it as it is."
        )
