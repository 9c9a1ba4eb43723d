"""One face of all results: tables, facts and sentences, from which text, HTML, plain data and data frames follow.

A result inherits from `Reported` and says in `report` what it shows. How that looks in a terminal and in a notebook is
decided here, once.
"""

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .tables import Table

if TYPE_CHECKING:
    from pandas import DataFrame


_LONG = 30  # rows that fill a screen


@dataclasses.dataclass(frozen=True)
class Report:
    """What a result shows of itself.

    Attributes:
        tables: the numbers, the most important table first; those without rows are not shown.
        facts: name and text of each line below the tables, as ("noise", "5 nm (stated)").
        notes: sentences about the numbers that ask for no action.
        warnings: what a reader of the numbers must know, in sentences; marked by an exclamation mark.
        errors: why the numbers cannot be used as they are, in sentences; marked by two.
        heading: what the facts are about, above them in HTML.
        data: the numbers with all their digits, by name: `Measured`, arrays, NamedTuples, and mappings and sequences
            of them, or of what JSON knows.

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

    def text(self) -> str:
        """The report as plain text, a blank line between its parts, without a newline at the end."""
        width = max((len(name) for name, _ in self.facts), default=0) + 2
        lines = [f"{name + ':':<{width}}{text}" for name, text in self.facts]
        lines += [*self.notes, *(f"!! {text}" for text in self.errors), *(f"! {text}" for text in self.warnings)]
        return "\n\n".join(filter(None, [*(table.text() for table in self.tables if table.rows), "\n".join(lines)]))

    def html(self) -> str:
        """The report as an HTML fragment of tables, every text in it escaped."""
        kinds = {"note": self.notes, "error": self.errors, "warning": self.warnings}
        sentences = [(kind, text) for kind, texts in kinds.items() for text in texts]
        below = Table([self.heading, ""], [*self.facts, *sentences])
        return "".join(table.html() for table in (*self.tables, below) if table.rows)

    def to_dict(self) -> dict[str, Any]:
        """The numbers as plain data: mappings, lists, numbers and texts."""
        return {name: plain_data(value) for name, value in self.data.items()}

    def to_dataframe(self) -> "DataFrame":
        """The first table as a data frame of numbers; a column of values with uncertainties gives two.

        A report without tables gives its facts.
        """
        table = self.tables[0] if self.tables else Table(["fact", "text"], self.facts)
        return table.to_dataframe()


class Reported(abc.ABC):
    """A result with that face; it defines `report`, and the rest follows.

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
        """What the result shows of itself."""

    def summary(self) -> str:
        """The result as plain text: tables with units and uncertainties, facts, warnings."""
        return self.report().text()

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, in SI units."""
        return self.report().to_dict()

    def to_dataframe(self) -> "DataFrame":
        """The result's first table as a data frame."""
        return self.report().to_dataframe()

    def thumbnails(self) -> Sequence[str]:
        """Small pictures of the result as SVG, below its tables in a notebook and made for it alone."""
        return ()

    def _repr_html_(self) -> str:
        report, pictures = self.report(), "".join(self.thumbnails())
        # Below a long table nobody would see them.
        long = sum(len(table.rows) for table in report.tables) > _LONG
        return pictures + report.html() if long else report.html() + pictures


def plain_data(value: Any) -> Any:
    """A value as JSON, YAML and tables know it.

    Args:
        value: arrays become lists, dataclasses and NamedTuples mappings of their fields, other sequences lists.

    Returns:
        Mappings, lists, numbers and texts; numbers that are not finite stay as they are.

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
