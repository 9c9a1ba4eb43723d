"""Records in MDF 4 files, the ASAM standard for vehicle measurements.

Channels are in groups, and each group has a clock. The reader supports stored values and linear conversions. Other
conversions may be formulas of any length, and files of unknown origin must not run code.
"""

import contextlib
import dataclasses
import graphlib
import io
import mmap
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..files import NUMBER, check_size, damage, library
from ..record import Record
from .assemble import records_of
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
# Data blocks: plain, or packed by zlib without and with transposition.
_PLAIN, _PACKED = 0, (1, 2)

# Position of the first block, after 64 bytes of identification, and the head of a block: mark, length, number of links.
_FIRST_BLOCK, _BLOCK = 64, struct.Struct("<8sQQ")
# Largest number of blocks in a file and of links in each; data lists have thousands of links.
_BLOCKS, _LINKS = 200_000, 100_000


def read_mdf(path: Path, choice: Choice) -> Record | list[Record]:
    """Read a channel of an `.mf4` file with its group's clock.

    Options as in `fricjax.read`, with

    - `column`: name of a channel, with or without its group: "Group 1/x".
    - `run`: the group, if several have channels of the same name.

    Raises:
        DataError: a damaged file, a file of version 3, no numeric channel, or a channel with a formula.
        UsageError: the package asammdf is not installed.
    """
    with path.open("rb") as stream:
        head = stream.read(16)
    if head[:3] != b"MDF" or head[8:9] not in b"34":
        raise DataError(f"{path.name} cannot be read as MDF; it is damaged or of another format.")
    if head[8:9] == b"3":
        raise DataError(f"{path.name} is of version {head[8:12].decode('ascii', 'replace')}; convert it to MDF 4.")
    asammdf = library(path, "asammdf", "mdf")
    with damage(path, "MDF"):
        _check_links(path)
        # The library prints tracebacks to stdout, which would mix with the output of a command. It gets a stream
        # instead of a path, because it unpacks paths to another place.
        with path.open("rb") as stream, contextlib.redirect_stdout(io.StringIO()), asammdf.MDF(stream) as file:
            return records_of(path, "mdf", _sheet(path, file), choice)


def _check_links(path: Path) -> None:
    """Refuse blocks linked in a circle, on which the library never returns."""
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        waiting, followers = [_FIRST_BLOCK], dict[int, list[int]]()
        while waiting:
            place = waiting.pop()
            if place in followers or not _FIRST_BLOCK <= place <= len(data) - _BLOCK.size:
                continue
            number = min(_BLOCK.unpack_from(data, place)[2], _LINKS, (len(data) - place - _BLOCK.size) // 8)
            links = struct.unpack_from(f"<{number}Q", data, place + _BLOCK.size)
            # In every block the first link leads forward. Other links may lead back, for example to a channel's axis.
            followers[place] = [link for link in links[:1] if link]
            waiting += links
            if len(followers) > _BLOCKS:
                raise DataError(f"{path.name} has more than {_BLOCKS} blocks; save one run in a file.")
    try:
        graphlib.TopologicalSorter(followers).prepare()
    except graphlib.CycleError as error:
        raise DataError(f"{path.name} is damaged: its blocks follow one another in a circle.") from error


def _sheet(path: Path, file: Any) -> Sheet:
    groups: dict[str, list[Column]] = {}
    for i, group in enumerate(file.groups):
        filled = group.channel_group.cycles_nr > 0
        columns = [_column(channel, (i, j), filled) for j, channel in enumerate(group.channels)]
        clocks = [column for column, channel in zip(columns, group.channels, strict=True) if _is_clock(channel)]
        time = clocks[0] if clocks else None
        columns = [column if column is time else dataclasses.replace(column, time=time) for column in columns]
        groups[f"Group {i + 1} {group.channel_group.acq_name or ''}".strip()] = columns

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        for i, j in (column.key for column in wanted):
            _check_data(path, file.groups[i], file.groups[i].channels[j])
        return [_values(file, *column.key) for column in wanted]

    return Sheet(grouped(groups), load, of="channel")


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


def _check_data(path: Path, group: Any, channel: Any) -> None:
    """Refuse a channel outside of its records, and wrong sizes.

    The library does not check this.
    """
    head, blocks = group.channel_group, list(group.get_data_blocks())
    stored, size = head.samples_byte_nr, sum(block.original_size for block in blocks)
    check_size(path, f"'{channel.name}'", max(head.cycles_nr, size // NUMBER))
    within = (
        0 <= 8 * channel.byte_offset + channel.bit_offset + channel.bit_count <= 8 * stored
        and channel.bit_count <= 64
        and channel.bit_offset < 8
        and 0 < head.cycles_nr * (stored + head.invalidation_bytes_nr) <= size
    )
    if channel.channel_type != _COUNTED_CLOCK and not within:
        raise DataError(f"{path.name} is damaged: '{channel.name}' does not lie within its records.")
    with path.open("rb") as stream:
        for block in blocks:
            stream.seek(block.address)
            if block.block_type != _PLAIN and not _unpacks(stream.read(block.compressed_size), block):
                raise DataError(f"{path.name} has data that contradict their packing; save it without compression.")


def _unpacks(packed: bytes, block: Any) -> bool:
    size = block.original_size
    return block.block_type in _PACKED and len(zlib.decompressobj().decompress(packed, size + 1)) == size


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
