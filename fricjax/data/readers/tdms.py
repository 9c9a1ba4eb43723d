"""Records in LabVIEW's TDMS files, in channels or waveforms."""

import dataclasses
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nptdms
import nptdms.log
import numpy as np

from ...errors import DataError
from .choice import Choice
from .sheet import Column, Sheet, array_columns, grouped
from .tables import seconds_of


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open a `.tdms` file.

    The times of a channel come from its waveform or from a channel of times. Channels are named with or without their
    group: "Run 1/x". The unit is the property `unit_string`, which LabVIEW writes. If several groups have channels of
    the same name, each group is a run.
    """
    # The library reports a truncated file only in its log, so silence the log and check for truncation below.
    nptdms.log.log_manager.set_level(logging.ERROR)
    # Pass a stream instead of a path: next to a path the library reads an index file, which may belong to another file.
    with path.open("rb") as stream, nptdms.TdmsFile.open(stream, raw_timestamps=True) as file:
        status = file.file_status
        lengths = (status.channel_statuses or {}).values()
        if status.incomplete_final_segment or any(each.expected_length != each.read_length for each in lengths):
            raise DataError(f"{path.name} is cut off: its last segment is not complete; copy or export it again.")
        groups = {group.name: [_column(channel) for channel in group.channels()] for group in file.groups()}
        yield Sheet(grouped(groups), lambda wanted: [_values(*column.key) for column in wanted], of="channel")


def _column(channel: Any) -> Column:
    """Return the column of a channel, with the times of its waveform.

    Time stamps become seconds.
    """
    dtype = np.dtype(channel.dtype or "O")
    unit = str(channel.properties.get("unit_string", "")).strip()
    [part] = array_columns(channel.name, dtype, (len(channel),), channel.name, unit=unit)
    if dtype.kind == "M":
        return dataclasses.replace(part, unit="s", fault=None if len(channel) else part.fault, key=(channel, None))
    start, interval = (_number(channel.properties.get(f"wf_{name}")) for name in ("start_offset", "increment"))
    time = Column(f"{part.name} (waveform)", "s", key=(channel, (start, interval))) if interval > 0 else None
    return dataclasses.replace(part, time=time, key=(channel, None))


def _number(value: Any) -> float:
    """Return a property as a number, zero if it is not numeric."""
    return float(value) if isinstance(value, int | float | np.number) and np.isfinite(value) else 0.0


def _values(channel: Any, waveform: tuple[float, float] | None) -> np.ndarray:
    if waveform is not None:
        return waveform[0] + waveform[1] * np.arange(len(channel))
    values = channel[:]
    # Stamps count fractions of 2^-64 s.
    seconds = seconds_of(values.as_datetime64("ns")) if hasattr(values, "as_datetime64") else None
    return np.asarray(values).astype(np.float64) if seconds is None else seconds
