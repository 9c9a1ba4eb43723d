"""Questions to the table in SQL, by DuckDB: shut off from files, networks and its own settings."""

from typing import Any

from ..errors import UsageError, needed


def asked(table: Any, sql: str) -> Any:
    """The answer of a table, called ``runs``, to SQL, as a data frame.

    Raises:
        UsageError: SQL that DuckDB refuses, or DuckDB is not installed.
    """
    duckdb = needed("A query", "duckdb", "batch")
    connection = duckdb.connect(":memory:", config={"enable_external_access": "false", "lock_configuration": "true"})
    try:
        connection.register("runs", table)
        answer = connection.execute(sql)
        if answer is None or connection.description is None:
            raise UsageError('The query gives no rows; write for example "select file, mu from runs order by mu".')
        return answer.df()
    except duckdb.Error as error:
        words = " ".join(str(error).split())
        raise UsageError(f"DuckDB refuses the query ({words[:300]}). The table is called runs.") from error
    finally:
        connection.close()
