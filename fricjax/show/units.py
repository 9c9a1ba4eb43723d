"""Units as they are shown: SI prefixes (a residual of 5e-9 m is read as 5 nm), and those of rigs that turn.

A prefix belongs to the first symbol of a unit and must not stand before a power: 1e-3 N/m is 1 mN/m, but 1e-3 m^2 and
1e-3 1/s stay as they are.
"""

import math
import re
from collections.abc import Mapping

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_PREFIXABLE = re.compile(r"(m|s|g|N|rad|Hz|J|W|Pa|V|A|K)(?![A-Za-z^*²³])")

# On a rotary rig angles stand for displacements, torques for forces and the moment of inertia for the mass. Units are
# looked up and never calculated: of N/m only the table knows whether it is a stiffness (N m/rad) or a line load.
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
    """What a record of this quantity shows: a displacement in "m", an angle in "rad"."""
    return "Displacement" if quantity == "m" else "Angle"


def rotary_unit(unit: str, quantity: str) -> str:
    """The unit of a coefficient on the rig whose records measure `quantity`.

    Args:
        unit: its unit on a linear rig, e.g. "N s/m".
        quantity: "m" for a linear rig, "rad" for a rotary one.

    Returns:
        The unit on that rig; one that is the same on both comes back unchanged.

    Examples:
        >>> from fricjax.show import rotary_unit
        >>> rotary_unit("N s/m", "rad"), rotary_unit("N s/m", "m"), rotary_unit("Hz", "rad")
        ('N m s/rad', 'N s/m', 'Hz')
    """
    return ROTARY.get(unit, unit) if quantity == "rad" else unit


def display_unit(magnitude: float, unit: str) -> tuple[float, str]:
    """The factor and the unit in which a number of this magnitude is read most easily.

    Args:
        magnitude: a typical or the largest value, in `unit`; its sign does not matter.
        unit: an SI unit as text, e.g. "m", "N s/m", "kg".

    Returns:
        `(factor, shown)`: the value times `factor` is in the unit `shown`, with 1 <= |value * factor| < 1000 as far as
        there are prefixes. Units that take no prefix, and magnitudes of zero, inf and nan, come back unchanged.

    Examples:
        >>> from fricjax.show import display_unit
        >>> display_unit(2e-3, "m"), display_unit(2e-3, "m^2")
        ((1000.0, 'mm'), (1.0, 'm^2'))
    """
    if not (math.isfinite(magnitude) and magnitude) or unit == "%":
        return 1.0, unit
    # The kilogram is the one SI unit with a prefix of its own, to which no second one may be added.
    exponent, stem = (3, unit[1:]) if re.match(r"kg(?![A-Za-z^*²³])", unit) else (0, unit)
    if not _PREFIXABLE.match(stem):
        return 1.0, unit
    # A power of ten takes the higher prefix, whichever way its logarithm was rounded: 1000 s are 1 ks.
    power = 3 * math.floor((math.log10(abs(magnitude)) + exponent) / 3 + 1e-12)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 10.0 ** (exponent - power), _PREFIXES[power] + stem
