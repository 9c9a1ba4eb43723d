"""What a file holds, before anything is chosen from it: named columns in their order, perhaps of several runs.

Every reader describes its file as a `Sheet`; which columns are displacement and time is decided in one place for all.
"""

import dataclasses
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .header import is_time, split_title

WIDEST = 16  # a matrix with more columns than this is a picture or a table of runs, not a trace beside its time


@dataclasses.dataclass(frozen=True)
class Column:
    """One column of a file.

    **Fields:**

    - `name`: what it is called, without unit and run: "Position", "/run1/x", "Theta1.signals.values".
    - `unit`: the unit in its title or attribute; None where there is none.
    - `run`: label of the run that it belongs to; None: it belongs to the file, as a common time does.
    - `title`: how the file writes the name; by default the name.
    - `time`: the column that holds its times, where the format says so (a dimension scale, Simulink's structure).
    - `fault`: why it cannot be a displacement or a time ("holds text"); None for numbers.
    - `bare`: whether the name is only its number, since the file names no columns.
    - `key`: what the reader finds its numbers by.
    """

    name: str
    unit: str | None = None
    run: str | None = None
    title: str = ""
    time: "Column | None" = None
    fault: str | None = None
    bare: bool = False
    key: Any = None

    @property
    def shown(self) -> str:
        """The title, or the name where there is none."""
        return self.title or self.name

    @property
    def is_time(self) -> bool:
        """Whether it is a time by its name or unit."""
        return is_time(self.last, self.unit)

    @property
    def last(self) -> str:
        """The name without the folders or structures that hold the column."""
        return re.split(r"[/.](?=[^\s/.])", self.name)[-1]


def folder_of(name: str) -> str:
    """What holds a column, by its name: "/run1" of "/run1/x", "run" of "run.x"; empty for one at the top."""
    return re.sub(r"[/.][^/.]*$", "", name) if re.search(r"[/.]", name.lstrip("/")) else ""


@dataclasses.dataclass(frozen=True)
class Sheet:
    """The columns of a file, and how their numbers are got.

    `load` gives the numbers of the columns asked for, each of shape (samples,); `place(i)` words where sample i of a
    column stands in the file ("row 17"); `advice` is added where times are missing ("its header says 1000 Hz"); `of` is
    what the format calls a column that may hold anything ("channel"), for the refusal of a file without numbers.
    """

    columns: Sequence[Column]
    load: Callable[[Sequence[Column]], list[np.ndarray]]
    place: Callable[[int], str] = lambda i: f"sample {i + 1}"
    advice: str = ""
    of: str = ""

    @property
    def runs(self) -> list[str]:
        """Labels of the runs, in the order of the file: of what has more than a time."""
        values = (column for column in self.columns if column.fault is None and not column.is_time)
        return list(dict.fromkeys(column.run for column in values if column.run is not None))


def grouped(groups: Mapping[str, Sequence[Column]]) -> list[Column]:
    """The columns of a file that keeps them in groups; groups that repeat the name of a signal are runs.

    Each is called as within its group, and titled with the group in front: "x" of "Run 1/x".
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
    """The column of a named array, its name taken apart; a matrix of few columns is one for each of them.

    `folder` is put in front of the name as it is: "/run1/", "run."; `unit` replaces the one in the name.
    """
    title = split_title(name)
    name, unit, run = folder + title.name, unit or title.unit, title.run
    lengths = [length for length in shape if length != 1]
    if len(lengths) == 2 and 2 <= min(lengths) <= WIDEST and _fault(dtype, (max(lengths),)) is None:
        return [Column(f"{name}[{i}]", unit, run, bare=True, key=(key, i)) for i in range(min(lengths))]
    return [Column(name, unit, run, str(key), fault=_fault(dtype, shape), key=(key, 0))]


def _fault(dtype: np.dtype, shape: tuple[int, ...]) -> str | None:
    """Why an array cannot be a displacement or a time."""
    if dtype.kind not in "fiub":
        return {"c": "holds complex numbers", "U": "holds text", "S": "holds text"}.get(dtype.kind, "holds no numbers")
    if 0 in shape:
        return "is empty"
    return None if sum(length != 1 for length in shape) == 1 else f"has shape {shape}"


def signal(array: np.ndarray, index: int) -> np.ndarray:
    """One signal of an array whose longer side is the time, shape (samples,)."""
    signals = np.atleast_2d(np.squeeze(np.asarray(array)))
    return (signals if signals.shape[0] <= signals.shape[1] else signals.T)[index].astype(np.float64)
