"""What the caller chose about a file, whatever its format."""

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from ..errors import UsageError

if TYPE_CHECKING:
    from .record import Record


def check_rate(rate: Any) -> None:
    """Refuse what is no rate of samples.

    Raises:
        UsageError: it is not a number, not positive or not finite.
    """
    try:
        usable = 0 < float(rate) < math.inf
    except (TypeError, ValueError):
        usable = False
    if not usable:
        raise UsageError(f"rate must be a positive number of samples per second, but it is {rate!r}.")


@dataclasses.dataclass(frozen=True)
class Choice:
    """What the caller chose for any format: see `fricjax.read`."""

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
        """Whether nothing is said about columns and units, so that a record of the package itself comes back whole."""
        told = (self.column, self.time, self.unit, self.time_unit, self.rate, self.run)
        return all(value is None for value in told)

    def applied(self, record: "Record") -> "Record":
        """A restored record with the noise and the direction chosen here."""
        if self.sigma is None and self.sign == 1:
            return record
        from .record import Step
        from .trace import Trace

        old = record.trace
        sigma = old.sigma if self.sigma is None else self.sigma
        chosen = {"sigma": self.sigma, "sign": self.sign}
        trace = Trace(old.t, self.sign * record.x, sigma, old.mask)
        return record.with_step(Step("read", plain(chosen), "noise or direction given by the caller"), trace=trace)


def plain(options: dict[str, Any]) -> dict[str, Any]:
    """The options as JSON can hold them."""
    return {
        key: value.tolist() if hasattr(value, "tolist") else value
        for key, value in options.items()
        if value is not None and (key, value) != ("sign", 1)
    }
