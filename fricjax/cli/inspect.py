"""``fricjax inspect``: what a record is like, before anything is fitted to it."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from .options import Output, Plot, Reading
from .output import PICTURES, check_targets, finish, log, working
from .runtime import prepare


def inspect(
    file: Annotated[Path, Argument(help="File with a displacement over time.", show_default=False)],
    reading: Reading,
    output: Output,
    plot: Plot = None,
) -> None:
    """Show what a record is like: rate, gaps, noise, amplitude, half-cycles, release, rest."""
    check_targets(("--plot", plot, PICTURES))
    with working(output, f"Inspecting {file.name}"):
        prepare(output)
        from ..data import inspect as inspect_record
        from .records import read_record

        record = read_record(file, reading)
        found = inspect_record(record)
    if plot is not None:
        from ..show import save

        save(record.plot(), plot)
        log(output, f"Picture: {plot}")
    steps = [str(step) for step in record.log]
    data = {**found.to_dict(), "log": steps, "files": {} if plot is None else {"plot": str(plot)}}
    finish(output, data, "\n".join([found.summary(), *(f"{'log':<22}{step}" for step in steps)]))
