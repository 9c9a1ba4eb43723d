"""What a rig looks like in a terminal and in a notebook."""

from typing import TYPE_CHECKING

from ..show.numbers import uncertain
from ..show.tables import Table
from .quantity import UNITS

if TYPE_CHECKING:
    from .rig import Rig


def table(rig: "Rig") -> Table:
    """One row per calibrated value: its name, value with uncertainty, unit and relative uncertainty."""
    rotary = type(rig.restoring).__name__ == "Pendulum"
    rows = []
    for name, number in rig.numbers().items():
        # Of a value of zero no part is uncertain.
        spread = f"{100 * number.relative:.2g} %" if number.value else ""
        relative = spread if number.std > 0 else "exact"
        value = uncertain(number.value, number.std) if number.std > 0 else f"{number.value:.10g}"
        rows.append((name, value, UNITS[name][int(rotary)], relative))
    title = f"Rig with {type(rig.restoring).__name__.lower()} restoring force"
    return Table(("quantity", "value", "unit", "uncertainty"), rows, title)
