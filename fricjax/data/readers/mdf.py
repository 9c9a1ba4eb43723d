"""Records in MDF 4 files, the ASAM standard for vehicle measurements.

Channels are in groups, and each group has a clock. The reader supports stored values and linear conversions. Other
conversions may be formulas of any length, and files of unknown origin must not run code.
"""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import asammdf
import numpy as np

from ...errors import DataError
from .choice import Choice
from .header import split_title
from .sheet import Column, Sheet, grouped

# Channel types: stored values, a stored clock of the group, a counted clock.
_VALUES, _CLOCK, _COUNTED_CLOCK = 0, 2, 3
_OVER_TIME = 1
# Data types of integers and floats in both byte orders; other types are texts, streams and dates.
_NUMBERS = range(6)
# Conversions: the stored value, and offset plus factor times the stored value.
_AS_IT_IS, _LINEAR = 0, 1


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open an `.mf4` file.

    Each group of channels has a clock. Channels are named with or without their group: "Group 1/x". If several groups
    have channels of the same name, each group is a run.
    """
    with path.open("rb") as stream:
        head = stream.read(16)
    if head[:3] != b"MDF" or head[8:9] not in b"34":
        raise DataError(f"{path.name} cannot be read as MDF; it is damaged or of another format.")
    if head[8:9] == b"3":
        raise DataError(f"{path.name} is of version {head[8:12].decode('ascii', 'replace')}; convert it to MDF 4.")
    # The library unpacks paths to another place, so it gets a stream.
    with path.open("rb") as stream, asammdf.MDF(stream) as file:
        groups: dict[str, list[Column]] = {}
        for i, group in enumerate[Any](file.groups):
            filled = group.channel_group.cycles_nr > 0
            columns = [_column(channel, (i, j), filled) for j, channel in enumerate(group.channels)]
            time = next((column for column, each in zip(columns, group.channels, strict=True) if _is_clock(each)), None)
            columns = [column if column is time else dataclasses.replace(column, time=time) for column in columns]
            groups[f"Group {i + 1} {group.channel_group.acq_name or ''}".strip()] = columns
        yield Sheet(grouped(groups), lambda wanted: [_values(file, *column.key) for column in wanted], of="channel")


def _is_clock(channel: Any) -> bool:
    return channel.channel_type in (_CLOCK, _COUNTED_CLOCK) and channel.sync_type == _OVER_TIME


def _column(channel: Any, key: tuple[int, int], filled: bool) -> Column:
    title, conversion = split_title(channel.name), channel.conversion
    unit = (channel.unit or getattr(conversion, "unit", "") or "").strip() or title.unit
    fault = None if filled else "is empty"
    if channel.data_type not in _NUMBERS or channel.channel_type not in (_VALUES, _CLOCK, _COUNTED_CLOCK):
        fault = "holds no numbers"
    elif conversion is not None and conversion.conversion_type not in (_AS_IT_IS, _LINEAR):
        fault = "is converted by a table or a formula, which is not evaluated"
    return Column(title.name, unit or ("s" if _is_clock(channel) else None), title.run, fault=fault, key=key)


def _values(file: Any, group: int, index: int) -> np.ndarray:
    """Return the numbers of a channel, with a linear conversion applied.

    Invalid samples are NaN.
    """
    channel = file.groups[group].channels[index]
    stored, invalid = file.get(group=group, index=index, raw=True, samples_only=True)
    values = np.asarray(stored).astype(np.float64)
    if channel.conversion is not None and channel.conversion.conversion_type == _LINEAR:
        values = channel.conversion.b + channel.conversion.a * values
    return values if invalid is None else np.where(np.asarray(invalid, dtype=bool), np.nan, values)
