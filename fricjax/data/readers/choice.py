"""What the caller chose about a file, whatever its format."""

import dataclasses
from typing import Any

from ...errors import UsageError
from ..units import check_rate


@dataclasses.dataclass(frozen=True)
class Choice:
    """The options of `fricjax.read` that every format takes; see there."""

    column: Any = None
    time: Any = None
    unit: str | None = None
    time_unit: str | None = None
    rate: float | None = None
    sigma: Any = None
    sign: int = 1
    run: Any = None

    def __post_init__(self) -> None:
        if self.rate is not None:
            check_rate(self.rate)
        if self.rate is not None and self.time is not None:
            raise UsageError("Give either time= (a column of times) or rate= (samples per second), not both.")
        if self.sign not in (1, -1):
            raise UsageError(f"sign must be 1 or -1, but it is {self.sign}.")

    @property
    def takes_all(self) -> bool:
        """Whether no column or unit is chosen, so that a record of the package itself comes back as it was written."""
        columns_and_units = (self.column, self.time, self.unit, self.time_unit, self.rate)
        return all(value is None for value in columns_and_units) and (self.run is None or self.all_runs)

    @property
    def all_runs(self) -> bool:
        """Whether a list of all runs is asked for, be it of one."""
        return str(self.run).lower() == "all"
