"""Parser of Thrift's compact protocol, for the metadata of Parquet files.

The metadata are checked before the library reads them: pyarrow ends the process if the list of a column contradicts
itself, and it allocates as much memory as the head of a page declares.
"""

from collections.abc import Callable
from typing import Any

type Structure = dict[int, Any]
"""Values by the number of their field: whole numbers, bytes, lists and structures."""
_LONGEST = 70  # longest number in bits, seven per byte


def structure(data: Any, place: int) -> tuple[Structure, int]:
    """Parse the structure at a position; return it and its end.

    Raises:
        ValueError: a number without end, or a value of unknown type.
        IndexError: the structure extends beyond the data.
    """
    fields, number = dict[int, Any](), 0
    while (mark := data[place]) != 0:
        if mark >> 4:
            number, place = number + (mark >> 4), place + 1
        else:
            number, place = _signed(data, place + 1)
        kind = mark & 15
        # Boolean values are stored in the mark itself.
        fields[number], place = (kind == 1, place) if kind in (1, 2) else _value(data, place, kind)
    return fields, place + 1


def _value(data: Any, place: int, kind: int) -> tuple[Any, int]:
    reader = _READERS.get(kind)
    if reader is None:
        raise ValueError(f"there is no value of kind {kind}")
    return reader(data, place)


def _unsigned(data: Any, place: int) -> tuple[int, int]:
    value = shift = 0
    while shift < _LONGEST:
        byte = data[place]
        value, shift, place = value | (byte & 127) << shift, shift + 7, place + 1
        if byte < 128:
            return value, place
    raise ValueError("a number has no end")


def _signed(data: Any, place: int) -> tuple[int, int]:
    value, place = _unsigned(data, place)
    return (value >> 1) ^ -(value & 1), place


def _bytes(data: Any, place: int) -> tuple[bytes, int]:
    length, place = _unsigned(data, place)
    if place + length > len(data):
        raise IndexError("a text goes on beyond the data")
    return bytes(data[place : place + length]), place + length


def _list(data: Any, place: int) -> tuple[list[Any], int]:
    mark, place = data[place], place + 1
    count = mark >> 4
    if count == 15:
        count, place = _unsigned(data, place)
    values = []
    for _ in range(count):
        value, place = _value(data, place, mark & 15)
        values.append(value)
    return values, place


_READERS: dict[int, Callable[[Any, int], tuple[Any, int]]] = {
    # Booleans in lists and bytes; integers of three lengths; a float, which is skipped because it is never used.
    **dict.fromkeys((1, 2, 3), lambda data, place: (data[place], place + 1)),
    **dict.fromkeys((4, 5, 6), _signed),
    7: lambda data, place: (None, place + 8),
    8: _bytes,
    **dict.fromkeys((9, 10), _list),
    12: structure,
}
