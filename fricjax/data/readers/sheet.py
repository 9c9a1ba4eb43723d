"""The content of a file: named columns, perhaps of several runs.

Each reader describes its file as a `Sheet`; `choose` selects displacement and time for all formats.
"""

import dataclasses
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .header import is_time, split_title

SINGLE = "is a single number"
WIDEST = 16  # a matrix with more columns is a picture or a table of runs, not a trace with its time


@dataclasses.dataclass(frozen=True)
class Column:
    """One column of a file.

    **Fields:**

    - `name`: the name without unit and run: "Position", "/run1/x", "Theta1.signals.values".
    - `unit`: the unit in its title or attribute; None if there is none.
    - `run`: label of its run; None: the column belongs to the whole file, as a common time does.
    - `title`: the name as written in the file; by default the name.
    - `time`: the column with its times, if the format defines it (a dimension scale, Simulink's structure).
    - `fault`: why it cannot be a displacement or a time ("holds text"); None for numbers.
    - `bare`: True if the name is only its number, because the file names no columns.
    - `clock`: True for times of day.
    - `key`: identifier of the column for the reader.
    """

    name: str
    unit: str | None = None
    run: str | None = None
    title: str = ""
    time: "Column | None" = None
    fault: str | None = None
    bare: bool = False
    clock: bool = False
    key: Any = None

    @property
    def shown(self) -> str:
        """The title, or the name if there is no title."""
        return self.title or self.name

    @property
    def is_time(self) -> bool:
        """True if name or unit are those of a time."""
        return is_time(self.last, self.unit)

    @property
    def last(self) -> str:
        """The name without the folders or structures that hold the column."""
        return re.split(r"[/.](?=[^\s/.])", self.name)[-1]


def folder_of(name: str) -> str:
    """Return the folder in a name: "/run1" of "/run1/x", "run" of "run.x".

    It is empty for a column at the top level.
    """
    return re.sub(r"[/.][^/.]*$", "", name) if re.search(r"[/.]", name.lstrip("/")) else ""


@dataclasses.dataclass(frozen=True)
class Sheet:
    """The columns of a file, with a function that loads their numbers.

    `load` returns the numbers of the given columns, each of shape (samples,). `place(i)` describes the position of
    sample i of a column in the file ("row 17"). `rate` is the sample rate in the text above the columns [Hz]. `of` is
    the format's name for a column that may hold any type of data ("channel"), for the message about a file without
    numbers. `record` holds the texts of a record from `fricjax.write`, with the columns `t`, `x`, `mask` and perhaps
    `sigma`; None for other files.
    """

    columns: Sequence[Column]
    load: Callable[[Sequence[Column]], list[np.ndarray]]
    place: Callable[[int], str] = lambda i: f"sample {i + 1}"
    rate: float | None = None
    of: str = ""
    record: Mapping[str, str] | None = None

    @property
    def runs(self) -> list[str]:
        """Labels of the runs with at least one displacement, in file order."""
        values = (column for column in self.columns if column.fault is None and not column.is_time)
        return list(dict.fromkeys(column.run for column in values if column.run is not None))


def grouped(groups: Mapping[str, Sequence[Column]]) -> list[Column]:
    """Return the columns of a file with groups.

    Groups that repeat the name of a signal are runs. The name of a column is its name within the group; its title
    includes the group: "x" and "Run 1/x".
    """
    signals = (column for columns in groups.values() for column in columns if not (column.fault or column.is_time))
    times = Counter(column.name for column in signals)
    runs = {name for name, columns in groups.items() if any(times[column.name] > 1 for column in columns)}
    return [
        dataclasses.replace(column, title=f"{name}/{column.shown}", run=name if name in runs else column.run)
        for name, columns in groups.items()
        for column in columns
    ]


def array_columns(
    name: str, dtype: np.dtype, shape: tuple[int, ...], key: Any, *, folder: str = "", unit: str | None = None
) -> list[Column]:
    """Return the columns of a named array.

    A matrix with few columns gives one for each, any other array one in total. Unit and run are split off from the
    name. `folder` is put in front of the name: "/run1/", "run."; `unit` replaces the one in the name.
    """
    title = split_title(name)
    name, unit, run = folder + title.name, unit or title.unit, title.run
    lengths = [length for length in shape if length != 1]
    if len(lengths) == 2 and 2 <= min(lengths) <= WIDEST and fault_of(dtype, (max(lengths),)) is None:
        return [Column(f"{name}[{i}]", unit, run, bare=True, key=(key, i)) for i in range(min(lengths))]
    return [Column(name, unit, run, str(key), fault=fault_of(dtype, shape), key=(key, 0))]


def fault_of(dtype: np.dtype, shape: tuple[int, ...]) -> str | None:
    """Return why an array cannot be a displacement or a time."""
    if dtype.kind not in "fiub":
        return {"c": "holds complex numbers", "U": "holds text", "S": "holds text"}.get(dtype.kind, "holds no numbers")
    if 0 in shape:
        return "is empty"
    if math.prod(shape) == 1:
        return SINGLE
    return None if sum(length != 1 for length in shape) == 1 else f"has shape {shape}"


def signal(array: np.ndarray, index: int) -> np.ndarray:
    """Return one signal of an array, shape (samples,).

    The longer side of the array is the time.
    """
    signals = np.atleast_2d(np.squeeze(np.asarray(array)))
    return (signals if signals.shape[0] <= signals.shape[1] else signals.T)[index].astype(np.float64)
