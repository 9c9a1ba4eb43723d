"""Whether the files that a command names can be read with its options, asked before any is opened."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .options import Reading


def check_records(paths: Sequence[Path], options: Reading) -> None:
    """Refuse files and options of reading that cannot go together.

    Args:
        paths: the records.
        options: how they are read.

    Raises:
        DataError: a file that is missing, empty, of an unknown format or named twice, or a unit that does not fit.
        UsageError: an option that does not fit the format, or that contradicts another.
    """
    from ..data.files import check_distinct, check_file
    from ..data.read import check
    from ..errors import UsageError
    from . import parsing

    for path in paths:
        check_file(path)
    check_distinct(paths)
    if options.crop is not None:
        low, high = parsing.span("--crop", options.crop)
        if low is not None and high is not None and not low < high:
            raise UsageError(f"--crop '{options.crop}' ends before it begins; write the earlier time first.")
    told = given(options)
    for path in paths:
        check(path, told)
    if told:
        _check_values(options)


def given(options: Reading) -> dict[str, Any]:
    """The options of `fricjax.read` that were given."""
    from . import parsing

    every = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    told = {name: value for name, value in every.items() if value is not None and name != "crop"}
    if "cells" in told:
        told["cells"] = [int(parsing.number("--cells", word)) for word in parsing.words(told["cells"])]
    return told


def _check_values(options: Reading) -> None:
    from ..data.readers.choice import Choice
    from ..data.readers.header import scale_of
    from ..data.units import DISPLACEMENT, TIME

    Choice(time=options.time, rate=options.rate, sign=1 if options.sign is None else options.sign)
    scale_of(None, options.unit, DISPLACEMENT, "the displacement", "unit")
    scale_of(None, options.time_unit, TIME, "the time", "time_unit")
