"""SI prefixes: a displacement of 2e-3 m is read as 2 mm, a residual of 5e-9 m as 5 nm.

A prefix belongs to the first symbol of a unit and must not stand before a power: 1e-3 N/m is 1 mN/m, but 1e-3 m^2 and
1e-3 1/s stay as they are.
"""

import math
import re

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_PREFIXABLE = re.compile(r"(m|s|g|N|rad|Hz|J|W|Pa|V|A|K)(?![A-Za-z^*²³])")


def display_unit(magnitude: float, unit: str) -> tuple[float, str]:
    """The factor and the unit in which a number of this magnitude is read most easily.

    Args:
        magnitude: a typical or the largest value, in `unit`; its sign does not matter.
        unit: an SI unit as text, e.g. "m", "N s/m", "kg".

    Returns:
        `(factor, shown)`: the value times `factor` is in the unit `shown`, with 1 <= |value * factor| < 1000 as far as
        there are prefixes. Units that take no prefix, and magnitudes of zero, inf and nan, come back unchanged.
    """
    if not (math.isfinite(magnitude) and magnitude) or unit == "%":
        return 1.0, unit
    exponent, stem = (3, unit[1:]) if re.match(r"kg(?![A-Za-z^*²³])", unit) else (0, unit)
    if not _PREFIXABLE.match(stem):
        return 1.0, unit
    power = 3 * math.floor((math.log10(abs(magnitude)) + exponent) / 3 + 1e-12)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 10.0 ** (exponent - power), _PREFIXES[power] + stem
