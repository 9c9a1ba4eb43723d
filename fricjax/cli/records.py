"""Records named by a command: early checks, and reading."""

import dataclasses
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..machine import parsing
from .options import Reading

if TYPE_CHECKING:
    from ..data import Record


def check_records(paths: Sequence[Path], reading: Reading) -> None:
    """Refuse files and reading options that do not fit together.

    Args:
        paths: files of the records.
        reading: options for reading.

    Raises:
        DataError: a file that is missing, empty, of an unknown format or named twice, or a unit that does not fit.
        UsageError: an option that does not fit the format, or that contradicts another.
    """
    from ..data.files import check_distinct, check_file
    from ..data.read import check
    from ..data.readers.choice import Choice, faults_of
    from ..data.readers.header import scale_of
    from ..data.units import READING, TIME, gravity

    for path in paths:
        check_file(path)
    check_distinct(paths)
    if reading.crop is not None:
        low, high = parsing.span("--crop", reading.crop)
        if low is not None and high is not None and not low < high:
            raise UsageError(f"--crop '{reading.crop}' ends before it begins; write the earlier time first.")
    options = options_of(reading)
    for path in paths:
        check(path, options)
    # These constructors check the values. Their results are not used.
    if options:
        if reading.repair is not None:
            faults_of(reading.repair)
        sign = 1 if reading.sign is None else reading.sign
        Choice(time=reading.time, rate=reading.rate, sign=sign, pendulum_length=reading.pendulum_length)
        scale_of(None, gravity(reading.unit), READING, "the displacement", "unit")
        scale_of(None, reading.time_unit, TIME, "the time", "time_unit")


def options_of(reading: Reading) -> dict[str, Any]:
    """Return the given options as arguments of `fricjax.read`."""
    options = {field.name: getattr(reading, field.name) for field in dataclasses.fields(reading)}
    options = {name: value for name, value in options.items() if value is not None}
    if "crop" in options:
        options["crop"] = parsing.span("--crop", options["crop"])
    if "cells" in options:
        options["cells"] = [int(parsing.number("--cells", word)) for word in parsing.words(options["cells"])]
    return options


def read_records(paths: Sequence[Path], reading: Reading) -> list["Record"]:
    """Read the records of all files with the same options.

    Raises:
        DataError: a file or record that cannot be used.
        UsageError: options that do not fit the format, or records of different quantities in one fit.
    """
    from ..data import read

    records: list[Record] = []
    for path in paths:
        content = read(path, **options_of(reading))
        records += content if isinstance(content, list) else [content]
    quantities = sorted({record.quantity for record in records})
    if len(quantities) > 1:
        raise UsageError(
            f"One fit cannot join records in {' with records in '.join(quantities)}: give files of one quantity, or a "
            "--unit."
        )
    return records


def read_record(path: Path, reading: Reading) -> "Record":
    """Read the single record of a file.

    Raises:
        DataError: a file or record that cannot be used.
        UsageError: options that do not fit the format, or several runs.
    """
    records = read_records([path], reading)
    if len(records) > 1:
        raise UsageError(f"{path.name} holds {len(records)} runs, but one is needed: give its number with --run.")
    return records[0]


def warn_of_doubts(records: Sequence["Record"]) -> None:
    """Warn of assumptions made in reading that the result does not mention."""
    for sentence in dict.fromkeys(sentence for record in records for sentence in record.doubts):
        # A warning is shown with --json too; a line of the log is not.
        warnings.warn(sentence, stacklevel=2)
