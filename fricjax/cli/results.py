"""``fricjax status``, ``query`` and ``report``: show earlier results."""

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from ..report.source import ENDINGS, kind_of
from .options import Output, Writing
from .output import deliver, finish, prepare, working
from .targets import check_targets

_SHOWN = 40  # largest number of rows shown of an answer
Store = Annotated[Path, Argument(help="Folder written by fricjax batch.", show_default=False)]


def status(
    store: Store,
    output: Output,
) -> None:
    """Show how many runs of an archive succeeded, and why others failed."""
    from ..archive.archive import open_archive

    archive = open_archive(store)
    finish(output, {"schema": "fricjax.status/1", **archive.to_dict()}, archive.summary())


def query(
    sql: Annotated[
        str, Argument(help="Query, such as \"select file, mu from runs where status = 'ok'\".", show_default=False)
    ],
    store: Store,
    output: Writing,
    csv: Annotated[Path | None, Option(help="Write the answer (.csv).", rich_help_panel="Output")] = None,
) -> None:
    """Query the table of an archive with SQL.

    The table is called runs. The query can read no other file and changes no data.
    """
    check_targets(output, ("--csv", csv, (".csv",)))
    from ..archive.archive import open_archive, write_csv
    from ..show import Table

    answer = open_archive(store).query(sql)
    shown = answer.head(_SHOWN).astype(object).where(answer.head(_SHOWN).notna(), None)
    rows = [[str(cell) if isinstance(cell, list | dict) else cell for cell in row] for row in shown.to_numpy().tolist()]
    more = len(answer) - len(rows)
    columns: list[str] = [str(name) for name in answer]
    text = "\n\n".join([Table(columns, rows).text(), f"{more} rows more" if more else ""]).rstrip()
    data: dict[str, Any] = {"schema": "fricjax.query/1", "columns": columns, "rows": answer.to_numpy().tolist()}
    write = lambda: {} if csv is None else {"csv": str(write_csv(answer, csv, overwrite=output.force))}
    deliver(output, data, text, write)


def report(
    source: Annotated[
        Path, Argument(help="Folder of an archive (fricjax batch), or a fit (fit.json).", show_default=False)
    ],
    output: Writing,
    out: Annotated[Path, Option(help="Path of the page (.html).", rich_help_panel=Writing.PANEL)] = Path("report.html"),
    title: Annotated[str, Option(help="Heading of the page.", rich_help_panel=Writing.PANEL)] = "",
) -> None:
    """Write an HTML page about an archive or a fit.

    The page has tables and pictures. It is one file and needs no network.
    """
    check_targets(output, ("--out", out, ENDINGS))
    kind = kind_of(source)
    with working(output, f"Making the page of {source.name or source}"):
        prepare(output)
        from ..report import page
        from ..show.files import write_text

        text = page(source, title=title)
    data = {"schema": "fricjax.report/1", "source": str(source), "kind": kind, "bytes": len(text.encode())}
    words = f"{out} shows the {kind} {source} in any browser, without a network."
    deliver(output, data, words, lambda: {"page": str(write_text(out, text, overwrite=output.force))})
