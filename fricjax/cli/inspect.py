"""``fricjax inspect``: what a record is like, before anything is fitted to it."""

from pathlib import Path
from typing import Annotated, Any

from typer import Argument

from .files import check_records
from .options import Plot, Reading, Writing
from .output import PICTURES, check_targets, deliver, numbered, working
from .records import read_records


def inspect(
    file: Annotated[Path, Argument(help="File with a displacement over time.", show_default=False)],
    reading: Reading,
    output: Writing,
    plot: Plot = None,
) -> None:
    """Show what a record is like: rate, gaps, noise, amplitude, half-cycles, release, rest."""
    check_targets(output, ("--plot", plot, PICTURES))
    check_records([file], reading)
    with working(output, f"Inspecting {file.name}"):
        records = read_records([file], reading)
        from ..data import inspect as inspect_record

        found = [inspect_record(record) for record in records]
    told: list[dict[str, Any]] = []
    texts: list[str] = []
    for each, record in zip(found, records, strict=True):
        steps = [str(step) for step in record.log]
        told.append({**each.to_dict(), "log": steps})
        texts.append("\n".join([each.summary(), *(f"{'log':<22}{step}" for step in steps)]))

    def draw() -> dict[str, str]:
        from ..show import save

        paths = numbered(plot, len(records))
        written = [
            save(record.plot(), path, overwrite=output.force) for path, record in zip(paths, records, strict=False)
        ]
        return {f"picture{'' if len(written) == 1 else f'_{i + 1}'}": str(path) for i, path in enumerate(written)}

    deliver(output, told[0] if len(told) == 1 else {"runs": told}, "\n\n".join(texts), draw)
