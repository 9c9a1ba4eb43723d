"""``fricjax inspect``: what a record is like, before anything is fitted to it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument

from .options import Plot, Reading, Writing
from .output import PICTURES, check_targets, deliver, working, write_picture
from .runtime import prepare

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def inspect(
    file: Annotated[Path, Argument(help="File with a displacement over time.", show_default=False)],
    reading: Reading,
    output: Writing,
    plot: Plot = None,
) -> None:
    """Show what a record is like: rate, gaps, noise, amplitude, half-cycles, release, rest."""
    check_targets(output, ("--plot", plot, PICTURES))
    with working(output, f"Inspecting {file.name}"):
        prepare(output)
        from ..data import inspect as inspect_record
        from .records import read_record

        record = read_record(file, reading)
        found = inspect_record(record)
    steps = [str(step) for step in record.log]
    text = "\n".join([found.summary(), *(f"{'log':<22}{step}" for step in steps)])

    def draw() -> "Figure":
        from .pictures import anatomy

        return anatomy(record)

    deliver(output, {**found.to_dict(), "log": steps}, text, lambda: write_picture(output, plot, draw))
