"""``fricjax inspect``: what a record is like, before anything is fitted to it."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from .files import check_records
from .options import Output, Plot, Reading
from .output import PICTURES, check_targets, finish, log, numbered, working
from .runtime import prepare


def inspect(
    file: Annotated[Path, Argument(help="File with a displacement over time.", show_default=False)],
    reading: Reading,
    output: Output,
    plot: Plot = None,
) -> None:
    """Show what a record is like: rate, gaps, noise, amplitude, half-cycles, release, rest."""
    check_targets(("--plot", plot, PICTURES))
    check_records([file], reading)
    with working(output, f"Inspecting {file.name}"):
        prepare(output)
        from ..data import inspect as inspect_record
        from .records import read_records

        records = read_records([file], reading)
        found = [inspect_record(record) for record in records]
    pictures = [] if plot is None else numbered(plot, len(records))
    for path, record in zip(pictures, records, strict=False):
        from ..show import save
        from .pictures import anatomy

        save(anatomy(record), path)
        log(output, f"Picture: {path}")
    logs = [[str(step) for step in record.log] for record in records]
    told = [{**each.to_dict(), "log": steps} for each, steps in zip(found, logs, strict=True)]
    files = {f"plot{'' if len(pictures) == 1 else f'_{i + 1}'}": str(path) for i, path in enumerate(pictures)}
    data = {**(told[0] if len(told) == 1 else {"runs": told}), "files": files}
    texts = [
        "\n".join([each.summary(), *(f"{'log':<22}{step}" for step in steps)])
        for each, steps in zip(found, logs, strict=True)
    ]
    finish(output, data, "\n\n".join(texts))
