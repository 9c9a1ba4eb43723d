"""``fricjax inspect``: what a record is like, before anything is fitted to it."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

from typer import Argument

from .options import Plot, Reading, Writing
from .output import deliver, working
from .records import check_records, read_records
from .targets import PICTURES, check_targets, numbered, write_picture


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
        # Nothing is computed that takes JAX, so that there is nothing to prepare and little to wait for.
        from ..data import inspect as inspect_record

        inspections = [inspect_record(record) for record in records]
    data: list[dict[str, Any]] = []
    texts: list[str] = []
    for inspection, record in zip(inspections, records, strict=True):
        steps = [str(step) for step in record.log]
        data.append({**inspection.to_dict(), "log": steps})
        report = inspection.report()
        logged = dataclasses.replace(report, facts=[*report.facts, *(("log", step) for step in steps)])
        texts.append(logged.text())

    def draw() -> dict[str, str]:
        pictures = {}
        for i, path in enumerate(numbered(plot, len(records))):
            name = "picture" if len(records) == 1 else f"picture_{i + 1}"
            pictures |= write_picture(output, path, records[i].plot, name)
        return pictures

    deliver(output, data[0] if len(data) == 1 else {"runs": data}, "\n\n".join(texts), draw)
