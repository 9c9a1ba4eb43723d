"""What was fitted, asked for later: ``fricjax status``, ``query`` and ``report``."""

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from ..report.source import ENDINGS, kind_of
from .options import Output, Writing
from .output import deliver, finish, prepare, working
from .targets import check_targets

_SHOWN = 40  # rows of an answer that are shown
Store = Annotated[Path, Argument(help="The folder that fricjax batch has written.", show_default=False)]


def status(
    store: Store,
    output: Output,
) -> None:
    """Show how many runs of an archive are done, what became of them, and why some failed."""
    from ..archive.archive import open_archive

    archive = open_archive(store)
    finish(output, archive.to_dict(), archive.summary())


def query(
    sql: Annotated[str, Argument(help="As \"select file, mu from runs where status = 'ok'\".", show_default=False)],
    store: Store,
    output: Writing,
    csv: Annotated[Path | None, Option(help="Write the answer (.csv).", rich_help_panel="Output")] = None,
) -> None:
    """Ask the table of an archive by SQL, in which it is called runs. Nothing else is read, and nothing changed."""
    check_targets(output, ("--csv", csv, (".csv",)))
    from ..archive.archive import open_archive, write_csv
    from ..show import Table

    answer = open_archive(store).query(sql)
    shown = answer.head(_SHOWN).astype(object).where(answer.head(_SHOWN).notna(), None)
    rows = [[str(cell) if isinstance(cell, list | dict) else cell for cell in row] for row in shown.to_numpy().tolist()]
    more = len(answer) - len(rows)
    text = "\n\n".join(
        [Table([str(name) for name in answer], rows).text(), f"{more} rows more" if more else ""]
    ).rstrip()
    data: dict[str, Any] = {"columns": [str(name) for name in answer], "rows": answer.to_numpy().tolist()}
    write = lambda: {} if csv is None else {"csv": str(write_csv(answer, csv, overwrite=output.force))}
    deliver(output, data, text, write)


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
