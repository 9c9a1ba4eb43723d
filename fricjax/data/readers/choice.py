"""Options of a file that do not depend on its format."""

import dataclasses
from typing import Any

from ...errors import UsageError, check_type, nearest
from ..units import DISPLACEMENT, check_rate
from .header import scale_of

_FAULTS = ("dropouts", "clock", "slips")


@dataclasses.dataclass(frozen=True)
class Choice:
    """The options of `fricjax.read` that all formats take; see there."""

    column: Any = None
    time: Any = None
    unit: str | None = None
    time_unit: str | None = None
    rate: float | None = None
    sigma: Any = None
    sign: int = 1
    run: Any = None
    pendulum_length: Any = None

    def __post_init__(self) -> None:
        for name in ("unit", "time_unit"):
            check_type(name, getattr(self, name), str | None, "a text")
        for name in ("column", "time"):
            check_type(name, getattr(self, name), str | int | list | None, "the name or the number of a column")
            # Variables of a .mat file may be joined.
            if isinstance(parts := getattr(self, name), list):
                object.__setattr__(self, name, "+".join(map(str, parts)))
        if self.rate is not None:
            check_rate(self.rate)
        if self.rate is not None and self.time is not None:
            raise UsageError("Give either time= (a column of times) or rate= (samples per second), not both.")
        if self.sign not in (1, -1):
            raise UsageError(f"sign must be 1 or -1, but it is {self.sign}.")

        if self.pendulum_length is not None and not self.length > 0:
            raise UsageError(f"pendulum_length must be positive, but it is {self.pendulum_length}.")

    @property
    def length(self) -> float:
        """Length of a filmed pendulum [m].

        Raises:
            DataError: a text that is neither a number nor a length.
        """
        try:
            return float(self.pendulum_length)
        except (TypeError, ValueError):
            return scale_of(None, str(self.pendulum_length), ("m",), "the length of the pendulum", "pendulum_length")[0]

    @property
    def takes_all(self) -> bool:
        """True if no column or unit is chosen.

        A record in the package's own format is then restored as it was written.
        """
        columns_and_units = (self.column, self.time, self.unit, self.time_unit, self.rate, self.pendulum_length)
        return all(value is None for value in columns_and_units) and (self.run is None or self.all_runs)

    @property
    def all_runs(self) -> bool:
        """True if the caller wants a list of all runs."""
        return str(self.run).lower() == "all"


def faults_of(words: str) -> dict[str, str | None]:
    """Parse a text such as `"dropouts,slips=158.2 nm"` into faults to repair.

    Returns the fringe size for each named fault, None if not given.

    Raises:
        UsageError: an unknown fault, or an empty text.
        DataError: a fringe that is neither a length nor an angle.
    """
    named: dict[str, str | None] = {}
    for word in filter(None, (word.strip() for word in str(words).split(","))):
        name, _, size = (part.strip() for part in word.partition("="))
        if name not in _FAULTS or (size and name != "slips"):
            raise UsageError(
                f"There is no fault '{word[:40]}' to repair.{nearest(name, _FAULTS)} Write repair='dropouts', "
                "repair='clock', repair='slips', or several with the size of a fringe: "
                "repair='dropouts,slips=158.2 nm'."
            )
        named[name] = size or None
        if size:
            scale_of(None, size, DISPLACEMENT, "the fringe", "repair")
    if not named:
        raise UsageError("repair= names no fault; write repair='dropouts', repair='clock' or repair='slips'.")
    return named
