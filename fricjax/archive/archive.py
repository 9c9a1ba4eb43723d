"""Results of an archive: one table, with queries and summaries."""

import contextlib
import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import DataError, UsageError, nearest, needed
from ..show import Report, Reported, Style, Table, styled
from .store import Store
from .table import PICTURES, STATUSES

if TYPE_CHECKING:
    from pandas import DataFrame

    from ..fitting.population import Population

# First characters of a spreadsheet formula, including whitespace that a spreadsheet strips first.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_REASONS = 8  # Maximum number of failure reasons in a summary.


class Archive(Reported):
    """Snapshot of the records of a store.

    Attributes:
        path: the folder of the store.
        table: all rows, an Arrow table.
        driver: the process that was working on the store, as "process 1234 on host"; empty if there was no process.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> _ = fj.write(fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0), "run.csv")
        >>> archive = fj.batch("run.csv", "results", machine)
        >>> archive
        Archive('results', 1 rows of 1 files: 1 ok)
        >>> archive.failures().empty
        True
        >>> archive.query("select count(*) as n from runs where status = 'ok'")["n"].tolist()
        [1]
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        store = Store(path)
        self.path = store.path
        self.description = store.description()
        self.driver = store.driver()
        self.table, _ = store.merged()

    def __len__(self) -> int:
        return self.table.num_rows

    def to_dataframe(self) -> "DataFrame":
        """Return all rows as a pandas data frame, sorted by file.

        There is one row for each run and law, with the columns of the table.
        """
        return self.table.to_pandas()

    def failures(self) -> "DataFrame":
        """Return the rows that are not ok, with their reasons.

        The columns are file, run, law, status and outcome.
        """
        table = self.table.select(["file", "run", "friction", "status", "outcome"]).to_pandas()
        return table[table["status"] != "ok"].reset_index(drop=True)

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows with each status."""
        statuses = self.table.column("status").to_pylist()
        return {name: statuses.count(name) for name in STATUSES}

    def population(self, name: str, by: str | None = None, *, friction: str | None = None) -> Any:
        """Compute the mean of a coefficient over ok runs, and its scatter.

        Args:
            name: a free parameter or a kinematic quantity, such as "mu".
            by: a column, such as "load"; gives one population for each of its values.
            friction: the law, required if several were fitted.

        Returns:
            A `Population`; its run numbers are row numbers of the table. With `by`, a mapping from value to population,
            without values that have fewer than three runs.

        Raises:
            UsageError: unknown column, or several laws and no choice.
            DataError: fewer than three valid runs.
        """
        table = self.table.drop_columns(PICTURES).to_pandas()
        laws = sorted(set(table["friction"]))
        if friction is None and len(laws) > 1:
            raise UsageError(f"The archive holds rows of {', '.join(laws)}; choose one with friction=.")
        if friction is not None and friction not in laws:
            raise UsageError(f"There is no row of {friction!r}.{nearest(friction, laws)} There are {', '.join(laws)}.")
        self._check_column(name, f"{name}_std", *([] if by is None else [by]))
        rows = table[table["friction"].isin([friction] if friction else laws)]
        if by is None:
            return _population(rows, name)
        groups = {}
        for value, group in rows.groupby(by):
            with contextlib.suppress(DataError):
                groups[value] = _population(group, name)
        if not groups:
            raise DataError(f"No value of {by} has three runs with a valid {name}.")
        return groups

    def _check_column(self, *names: str) -> None:
        for name in names:
            if name not in self.table.column_names:
                known = self.table.drop_columns(PICTURES).column_names
                words = f"{nearest(name, known)} It has {', '.join(known)}."
                raise UsageError(f"The archive has no column {name!r}.{words}")

    def query(self, sql: str) -> "DataFrame":
        """Query the table, named ``runs``, by SQL without access to other data.

        Raises:
            UsageError: invalid SQL, or DuckDB is not installed.
        """
        duckdb = needed("A query", "duckdb", "batch")
        # DuckDB allows access to its temporary folder even then, so it gets none.
        shut = {"enable_external_access": "false", "temp_directory": "", "lock_configuration": "true"}
        with contextlib.closing(duckdb.connect(":memory:", config=shut)) as connection:
            try:
                connection.register("runs", self.table)
                answer = connection.execute(sql)
                if answer is None or connection.description is None:
                    example = '"select file, mu from runs order by mu"'
                    raise UsageError(f"The query gives no rows; write for example {example}.")
                return answer.df()
            except duckdb.Error as error:
                words = " ".join(str(error).split())
                raise UsageError(f"DuckDB refuses the query ({words[:300]}). The table is called runs.") from error

    def to_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write all rows as CSV without formulas; omit the sketch columns.

        Raises:
            FileExistsError: the file exists and `overwrite` is False.
            OSError: the file cannot be written.
        """
        return write_csv(self.table.drop_columns(PICTURES).to_pandas(), path, overwrite=overwrite)

    def plot(self, name: str = "mu", against: str = "run", *, style: Style = "screen") -> Any:
        """Plot a parameter of all ok runs with standard errors.

        Args:
            name: a free parameter or a kinematic quantity.
            against: a numeric column, such as "load"; "run" is the order in the table.
            style: as of :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.

        Raises:
            UsageError: unknown column.
        """
        from .show import parameter_figure

        self._check_column(name, *([] if against == "run" else [against]))
        return styled(parameter_figure(self.to_dataframe(), name, against), style)

    def report(self) -> Report:
        """Summarise status counts, fitted populations and reasons of failures."""
        counts = self.counts
        pairs = Counter(zip(*(self.table.column(name).to_pylist() for name in ("friction", "status")), strict=True))
        laws = sorted({law for law, _ in pairs})
        table = Table(["law", *counts], [[law, *(str(pairs[law, status]) for status in counts)] for law in laws])
        failures = self.failures()
        reasons = failures["outcome"].str.slice(0, 100).value_counts() if len(failures) else {}
        rows = [[str(count), reason] for reason, count in list(reasons.items())[:_REASONS]]
        files = len(set(self.table.column("file").to_pylist()))
        version = self.description["versions"]["fricjax"]
        facts = [("store", str(self.path)), ("files", str(files)), ("made by", f"fricjax {version}")]
        facts += [("at work", self.driver)] if self.driver else []
        wrong = sum(counts.values()) - counts["ok"]
        notes = [f"{wrong} of {len(self)} rows are not ok: failures() lists them."] if wrong else []
        data = {"path": str(self.path), "rows": len(self), "files": files, "counts": counts}
        return Report([table, Table(["runs", "reason"], rows)], facts, notes, heading="Archive", data=data)

    def __repr__(self) -> str:
        files = len(set(self.table.column("file").to_pylist()))
        counts = ", ".join(f"{count} {name}" for name, count in self.counts.items() if count)
        return f"Archive({str(self.path)!r}, {len(self)} rows of {files} files: {counts or 'empty'})"


def _population(rows: "DataFrame", name: str) -> "Population":
    """Return the population of some rows, with row numbers of the table."""
    from ..fitting.population import population

    value, std, combined = (rows[f"{name}{end}"].to_numpy(float) for end in ("", "_std", "_combined_std"))
    # The uncertainty of rig inputs is common to all runs, so it does not average out.
    common = np.nan_to_num(np.sqrt(np.maximum(combined**2 - std**2, 0.0)))
    pooled = population(np.where(rows["status"] == "ok", value, np.nan), std, [common])
    numbered = {field: tuple(rows.index[list(getattr(pooled, field))].tolist()) for field in ("outliers", "left_out")}
    return pooled._replace(**numbered)


def open_archive(path: str | os.PathLike[str]) -> Archive:
    """Open a store made by `fricjax.batch` or ``fricjax batch``.

    This also works while a batch is running.

    Raises:
        DataError: no store, another schema, or a damaged file.
        UsageError: pyarrow is not installed.

    Examples:
        >>> import fricjax as fj
        >>> fj.open_archive("nowhere")
        Traceback (most recent call last):
        ...
        fricjax.errors.DataError: nowhere holds no archive: there is no study.json in it. Make one: fricjax batch.
    """
    return Archive(path)


def results(path: str | os.PathLike[str]) -> "DataFrame":
    """Return the table of a store as a data frame.

    Raises:
        DataError, UsageError: as `open_archive`.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> _ = fj.write(fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0), "one.csv")
        >>> _ = fj.batch("one.csv", "one", machine)
        >>> fj.archive.results("one")["status"].tolist()
        ['ok']
    """
    return open_archive(path).to_dataframe()


def write_csv(table: "DataFrame", path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a data frame as CSV, with formulas as text."""
    from ..show.files import write_text

    text = table.map(_escaped).rename(columns=lambda name: _escaped(str(name)))
    return write_text(path, text.to_csv(index=False), overwrite=overwrite)


def _escaped(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell
