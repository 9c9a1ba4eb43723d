"""Units for display: SI prefixes, and units of rotary rigs.

A residual of 5e-9 m is shown as 5 nm. A prefix belongs to the first symbol of a unit, and a power takes no prefix:
1e-3 N/m is 1 mN/m, but 1e-3 m^2 and 1e-3 1/s remain unchanged.
"""

import math
import re
from collections.abc import Mapping

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_PREFIXABLE = re.compile(r"(m|s|g|N|rad|Hz|J|W|Pa|V|A|K)(?![A-Za-z^*²³])")

# On a rotary rig angles replace displacements, torques replace forces, and the moment of inertia replaces the mass.
# A table is needed: the unit N/m alone does not say whether it is a stiffness (N m/rad) or a line load.
ROTARY: Mapping[str, str] = {
    "m": "rad",
    "m/s": "rad/s",
    "kg": "kg m^2",
    "N": "N m",
    "N/m": "N m/rad",
    "N/m^3": "N m/rad^3",
    "N s/m": "N m s/rad",
    "N s^2/m^2": "N m s^2/rad^2",
}


def displacement_name(quantity: str) -> str:
    """Name of the measured quantity: "Displacement" for "m", "Angle" for "rad"."""
    return "Displacement" if quantity == "m" else "Angle"


def rotary_unit(unit: str, quantity: str) -> str:
    """Convert the unit of a coefficient to a linear or rotary rig.

    Args:
        unit: unit on a linear rig, e.g. "N s/m".
        quantity: unit of the displacement, "m" for a linear rig and "rad" for a rotary one, or that of its derivative.

    Returns:
        The unit on that rig. A unit that is the same on both rigs is returned unchanged.

    Examples:
        >>> from fricjax.show import rotary_unit
        >>> rotary_unit("N s/m", "rad"), rotary_unit("N s/m", "m"), rotary_unit("Hz", "rad")
        ('N m s/rad', 'N s/m', 'Hz')
    """
    return ROTARY.get(unit, unit) if quantity.startswith("rad") else unit


def display_unit(magnitude: float, unit: str) -> tuple[float, str]:
    """Choose the SI prefix for a number of this magnitude.

    Args:
        magnitude: a typical value or the largest one, in `unit`; the sign is ignored.
        unit: an SI unit as text, e.g. "m", "N s/m", "kg".

    Returns:
        `(factor, shown)`: the value times `factor` is in the unit `shown`, with 1 <= |value * factor| < 1000 as far as
        the prefixes reach. A unit without prefixes, and a magnitude of zero, inf or nan, are returned unchanged.

    Examples:
        >>> from fricjax.show import display_unit
        >>> display_unit(2e-3, "m"), display_unit(2e-3, "m^2")
        ((1000.0, 'mm'), (1.0, 'm^2'))
    """
    if not (math.isfinite(magnitude) and magnitude) or unit == "%":
        return 1.0, unit
    # The kilogram already has a prefix, and a second one is not allowed.
    exponent, stem = (3, unit[1:]) if re.match(r"kg(?![A-Za-z^*²³])", unit) else (0, unit)
    if not _PREFIXABLE.match(stem):
        return 1.0, unit
    # An exact power of ten takes the higher prefix (1000 s are 1 ks), whichever way its logarithm is rounded.
    power = 3 * math.floor((math.log10(abs(magnitude)) + exponent) / 3 + 1e-12)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 10.0 ** (exponent - power), _PREFIXES[power] + stem
