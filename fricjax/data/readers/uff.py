"""Records in universal files (data set 58), the format of modal analysis."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from ...errors import DataError
from .choice import Choice
from .header import is_unit
from .sheet import Column, Sheet

_FUNCTION = 58
# Function types with samples over time: "general", which programs write for any type, and "time response".
_OVER_TIME = (0, 1)
_COMPLEX = (5, 6)
# Measured quantity by code; 0 is unknown. A displacement is then identified by its name alone.
_KINDS = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "excitation", 17: "time"}
_DIRECTIONS = {1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
_DIRECTIONS |= {-code: f"-{name[1:]}" for code, name in _DIRECTIONS.items()}
# Unit of length of each system of units, by the code in data set 164.
_LENGTHS = {1: "m", 2: "ft", 3: "m", 4: "ft", 5: "mm", 6: "cm", 7: "in", 8: "mm", 10: "mm"}


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open a universal file, text or binary, with time responses.

    These are the data sets 58 or 58b. A column is named by quantity, point and direction: "displacement 3 +Z". The unit
    is the label of the ordinate, else that of the system of units in data set 164. If several data sets belong to the
    same point, each is a run.
    """
    file: Any = pyuff.UFF(str(path))
    kinds = file.get_set_types()
    heads = {i: file.read_sets(i, header_only=True) for i, kind in enumerate(kinds) if kind == _FUNCTION}
    heads = {i: head for i, head in heads.items() if head["func_type"] in _OVER_TIME}
    if not heads:
        raise DataError(f"{path.name} holds no time response (data set {_FUNCTION}) that could be a record.")
    systems = (file.read_sets(i) for i, kind in enumerate(kinds) if kind == 164)
    length = _LENGTHS.get(next((system["units_code"] for system in systems), 0))
    names = {i: _name(head) for i, head in heads.items()}
    often = Counter(names.values())
    columns = []
    for i, head in heads.items():
        time = Column("time", _label(head, "abscissa") or "s", key=(i, "x"))
        fault = "holds complex numbers" if head["ord_data_type"] in _COMPLEX else None
        unit = _label(head, "ordinate") or (length if head["ordinate_spec_data_type"] == 8 else None)
        run = f"Set {i + 1}" if often[names[i]] > 1 else None
        columns.append(Column(names[i], unit, run, time=time, fault=fault, key=(i, "data")))

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        sets = {i: file.read_sets(i) for i in {column.key[0] for column in wanted}}
        return [_values(path, sets[i], what) for i, what in (column.key for column in wanted)]

    yield Sheet(columns, load)


def _name(head: dict[str, Any]) -> str:
    """Return the measured quantity with point and direction, if known."""
    label = (head.get("ordinate_axis_lab") or "").strip()
    kind = _KINDS.get(head["ordinate_spec_data_type"]) or (label if label.upper() != "NONE" else "") or "signal"
    return " ".join(filter(None, [kind, str(head["rsp_node"] or ""), _DIRECTIONS.get(head["rsp_dir"], "")]))


def _label(head: dict[str, Any], axis: str) -> str | None:
    """Return the unit of an axis, None if invalid, such as NONE."""
    text = (head.get(f"{axis}_axis_units_lab") or "").strip()
    return text if text and is_unit(text) else None


def _values(path: Path, data: dict[str, Any], what: str) -> np.ndarray:
    """Return the numbers of a set without padding at its end."""
    values, number = np.asarray(data[what], dtype=np.float64), data["num_pts"]
    if values.size < number:
        raise DataError(f"{path.name} is damaged: a data set promises {number} samples and holds {values.size}.")
    return values[:number]
