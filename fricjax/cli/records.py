"""Reading the records that a command works on."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..data import Record, crop, read
from ..data.errors import UsageError
from . import parsing
from .options import Reading


def read_record(path: Path, options: Reading) -> Record:
    """One record, read and cropped as the options say.

    Raises:
        DataError: a file or record that cannot be used.
        UsageError: options that do not fit the format.
    """
    record = read(path, **_reader_options(options))
    if options.crop is None:
        return record
    return crop(record, *parsing.span("--crop", options.crop))


def read_records(paths: Sequence[Path], options: Reading) -> list[Record]:
    """Several records, all read with the same options; they must measure the same quantity.

    Raises:
        UsageError: lengths and angles in one fit.
    """
    records = [read_record(path, options) for path in paths]
    kinds = {record.quantity for record in records}
    if len(kinds) > 1:
        raise UsageError(
            "One fit cannot join records in m with records in rad: give files of one quantity, or a --unit."
        )
    return records


def _reader_options(options: Reading) -> dict[str, Any]:
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    given = {name: value for name, value in given.items() if value is not None and name != "crop"}
    if "cells" in given:
        given["cells"] = [int(parsing.number("--cells", word)) for word in parsing.words(given["cells"])]
    if given.get("delimiter") in ("\\t", "tab"):
        given["delimiter"] = "\t"
    return given
