"""Reports of results, as text, HTML, plain data and data frames.

A result inherits from `Reported` and returns its tables, facts and sentences from `report`. This module formats all
reports in the same way for terminals and notebooks.
"""

import abc
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .tables import Table, dataframe

if TYPE_CHECKING:
    from pandas import DataFrame


_LONG = 30  # rows that fill a screen


@dataclasses.dataclass(frozen=True)
class Report:
    """Tables, facts and sentences of a result.

    Attributes:
        tables: the numbers, the most important table first. Tables without rows are not shown.
        facts: name and text of each line below the tables, e.g. ("noise", "5 nm (stated)").
        notes: sentences about the numbers that need no action.
        warnings: sentences that every reader of the numbers must know, each after an exclamation mark.
        errors: reasons in sentences why the numbers cannot be used, each after two exclamation marks.
        heading: subject of the facts, above them in HTML.
        data: the numbers with all digits, by name: `Measured`, arrays, NamedTuples, types of JSON, and mappings and
            sequences of these.
        units: SI units of the numbers in `data`, for the data frame of a report without tables.

    Examples:
        >>> from fricjax.show import Report, Table
        >>> table = Table(["Parameter", "Value"], [["mu", "0.21452(31)"]])
        >>> print(Report([table], [("noise", "5 nm"), ("runs", "2")], warnings=["The rest is short."]).text())
        Parameter        Value
        ─────────  ───────────
        mu         0.21452(31)
        <BLANKLINE>
        noise: 5 nm
        runs:  2
        ! The rest is short.
    """

    tables: Sequence[Table]
    facts: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    errors: Sequence[str] = ()
    heading: str = "Facts"
    data: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def text(self) -> str:
        """Return plain text without a newline at the end.

        A blank line separates the tables and the lines below them.
        """
        width = max((len(name) for name, _ in self.facts), default=0) + 2
        lines = [f"{name + ':':<{width}}{text}" for name, text in self.facts]
        lines += [*self.notes, *(f"!! {text}" for text in self.errors), *(f"! {text}" for text in self.warnings)]
        return "\n\n".join(filter(None, [*(table.text() for table in self.tables if table.rows), "\n".join(lines)]))

    def html(self) -> str:
        """Return an HTML fragment of tables; every text is escaped."""
        kinds = {"note": self.notes, "error": self.errors, "warning": self.warnings}
        sentences = [(kind, text) for kind, texts in kinds.items() for text in texts]
        below = Table([self.heading, ""], [*self.facts, *sentences])
        return "".join(table.html() for table in (*self.tables, below) if table.rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as mappings, lists, numbers and texts."""
        return {name: plain_data(value) for name, value in self.data.items()}

    def to_dataframe(self) -> "DataFrame":
        """Return the numbers of the first table as a data frame.

        A report without tables gives one row with the values of `data`. The numbers are in SI units.
        """
        if self.tables:
            return self.tables[0].to_dataframe()
        row = {name: math.nan if value is None else value for name, value in self.data.items()}
        return dataframe([row], self.units)


class Reported(abc.ABC):
    """Base class of results; a subclass defines `report`.

    Examples:
        >>> import dataclasses
        >>> from fricjax.rig import Measured
        >>> from fricjax.show import Report, Reported, Table
        >>> @dataclasses.dataclass(frozen=True)
        ... class Weighing(Reported):
        ...     mass: Measured
        ...
        ...     def report(self):
        ...         return Report([Table(["quantity", "value"], [["mass", self.mass]])], data=vars(self))
        >>> Weighing(Measured(0.4107, 0.0003)).to_dict()
        {'mass': {'value': 0.4107, 'std': 0.0003}}
    """

    @abc.abstractmethod
    def report(self) -> Report:
        """Return the tables, facts and sentences of the result."""

    def summary(self) -> str:
        """Return tables with units and uncertainties, facts and warnings as text."""
        return self.report().text()

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, in SI units."""
        return self.report().to_dict()

    def to_dataframe(self) -> "DataFrame":
        """Return the numbers in SI units as a data frame.

        Column names are identifiers. The units are in the column `unit`, or in ``attrs["units"]``, by column, if they
        are the same in all rows.
        """
        return self.report().to_dataframe()

    def thumbnails(self) -> Sequence[str]:
        """Return small SVG pictures to show below the tables in a notebook."""
        return ()

    def _repr_html_(self) -> str:
        report, pictures = self.report(), "".join(self.thumbnails())
        # A reader would not see pictures below a long table.
        long = sum(len(table.cells()) for table in report.tables) > _LONG
        return pictures + report.html() if long else report.html() + pictures


def plain_data(value: Any) -> Any:
    """Convert a value to types that JSON, YAML and tables can hold.

    Args:
        value: arrays and sequences become lists, dataclasses and NamedTuples become mappings of their fields.

    Returns:
        Mappings, lists, numbers and texts. Infinite numbers and NaN are kept.

    Examples:
        >>> import numpy as np
        >>> from fricjax.rig import Measured
        >>> from fricjax.show import plain_data
        >>> plain_data({"mass": Measured(0.41, 0.001), "x": np.arange(2)})
        {'mass': {'value': 0.41, 'std': 0.001}, 'x': [0, 1]}
    """
    if hasattr(value, "tolist"):
        return value.tolist()
    if hasattr(value, "_asdict"):
        return plain_data(value._asdict())
    if isinstance(value, Mapping):
        return {name: plain_data(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(part) for part in value]
    if dataclasses.is_dataclass(value):
        return {field.name: plain_data(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return value
