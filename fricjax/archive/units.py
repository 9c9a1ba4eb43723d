"""In which units the columns of an archive's table are, by their names."""

from collections.abc import Sequence

from ..fitting.derived import UNITS
from ..fitting.names import NUISANCES
from ..show import rotary_unit

# Of the columns that are no parameters; "x" stands for the unit of the displacement.
_PLAIN_UNITS = {
    "residual_rms": "x",
    "sigma": "x",
    "amplitude": "x",
    "rate": "Hz",
    "duration": "s",
    "load": "N",
    "seconds_read": "s",
    "seconds_fit": "s",
}


def unit_of(name: str, laws: Sequence[str], quantity: str = "m") -> str:
    """SI unit of a column by its name.

    Args:
        name: of a parameter, of one of the kinematics, or of another column.
        laws: friction laws of the table, as on the command line, whose coefficients may be meant.
        quantity: "m", or "rad" for a rotary rig.
    """
    stem = name.split("[")[0].rsplit(".", 1)[-1]
    unit = {**_PLAIN_UNITS, **_coefficient_units(laws), **NUISANCES, **UNITS}.get(stem, "")
    return quantity if unit == "x" else rotary_unit(unit, quantity)


def _coefficient_units(laws: Sequence[str]) -> dict[str, str]:
    """Units of the coefficients of the machine and of these laws."""
    from .. import friction
    from ..friction.catalogue import CATALOGUE
    from ..oscillator import Oscillator, restoring

    summands = {part for law in laws for part in law.split("+")}
    classes = [Oscillator, restoring.Cubic, restoring.Structural]
    classes += [getattr(friction, CATALOGUE[name].name) for name in sorted(summands) if name in CATALOGUE]
    return {name: each.unit for cls in classes for name, each in getattr(cls, "coefficients", {}).items()}
