"""Reading the records that a command works on."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from . import parsing
from .files import given
from .options import Reading

if TYPE_CHECKING:
    from ..data import Record


def read_records(paths: Sequence[Path], options: Reading) -> list["Record"]:
    """The records of the files, all read and cropped with the same options; they must measure the same quantity.

    Raises:
        DataError: a file or record that cannot be used.
        UsageError: options that do not fit the format, or lengths and angles in one fit.
    """
    from ..data import crop, read
    from ..errors import UsageError

    records: list[Record] = []
    for path in paths:
        found = read(path, **given(options))
        records += found if isinstance(found, list) else [found]
    if len({record.quantity for record in records}) > 1:
        raise UsageError(
            "One fit cannot join records in m with records in rad: give files of one quantity, or a --unit."
        )
    if options.crop is None:
        return records
    return [crop(record, *parsing.span("--crop", options.crop)) for record in records]


def read_record(path: Path, options: Reading) -> "Record":
    """The one record of a file.

    Raises:
        DataError: a file or record that cannot be used.
        UsageError: options that do not fit the format, or several runs.
    """
    from ..errors import UsageError

    records = read_records([path], options)
    if len(records) > 1:
        raise UsageError(f"{path.name} holds {len(records)} runs, but one is needed: give its number with --run.")
    return records[0]


def tell_doubts(records: Sequence["Record"]) -> None:
    """Warn of what was taken for granted in reading, where the result does not say so itself."""
    for sentence in dict.fromkeys(sentence for record in records for sentence in record.doubts):
        warnings.warn(sentence, stacklevel=2)
