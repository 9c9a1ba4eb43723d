"""``fricjax report``: one page about an archive or a fit, to be opened in any browser."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from ..report.source import ENDINGS, kind_of
from .options import Writing
from .output import deliver, prepare, working
from .targets import check_targets


def report(
    source: Annotated[
        Path, Argument(help="Folder of an archive (fricjax batch), or a fit (fit.json).", show_default=False)
    ],
    output: Writing,
    out: Annotated[Path, Option(help="The page (.html).", rich_help_panel=Writing.PANEL)] = Path("report.html"),
    title: Annotated[str, Option(help="Heading of the page.", rich_help_panel=Writing.PANEL)] = "",
) -> None:
    """Write one page of HTML with tables and pictures of an archive or of a fit; it needs no network."""
    check_targets(output, ("--out", out, ENDINGS))
    kind = kind_of(source)
    with working(output, f"Making the page of {source.name or source}"):
        prepare(output)
        from ..report import page
        from ..show.files import write_text

        text = page(source, title=title)
    data = {"source": str(source), "kind": kind, "bytes": len(text.encode())}
    words = f"{out} shows the {kind} {source} in any browser, without a network."
    deliver(output, data, words, lambda: {"page": str(write_text(out, text, overwrite=output.force))})
