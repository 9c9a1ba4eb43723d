"""``fricjax query``: questions to the table of an archive, in SQL."""

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from .options import Writing
from .output import deliver
from .targets import check_targets

_SHOWN = 40  # rows that are shown


def query(
    sql: Annotated[str, Argument(help="As \"select file, mu from runs where status = 'ok'\".", show_default=False)],
    store: Annotated[Path, Argument(help="The folder that fricjax batch has written.", show_default=False)],
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
