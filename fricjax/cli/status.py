"""``fricjax status``: how far an archive is, also while it is worked on."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from .options import Output
from .output import finish


def status(
    store: Annotated[Path, Argument(help="The folder that fricjax batch has written.", show_default=False)],
    output: Output,
) -> None:
    """Show how many runs of an archive are done, what became of them, and why some failed."""
    from ..archive.archive import open_archive

    archive = open_archive(store)
    finish(output, archive.to_dict(), archive.summary())
