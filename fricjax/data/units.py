"""Units at the edge: what a file calls a micrometre or a degree becomes metres, radians and seconds here, once.

Only three quantities occur in a record: a length or an angle for the displacement, and a time.
"""

import functools
from typing import Any

from .errors import DataError

EXAMPLES = {"m": "'m', 'mm', 'um' or 'nm'", "rad": "'rad', 'mrad' or 'deg'", "s": "'s', 'ms' or 'us'"}
DISPLACEMENT = ("m", "rad")
TIME = ("s",)


@functools.lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


@functools.lru_cache(maxsize=256)
def si_unit(unit: str) -> tuple[float, str] | None:
    """Factor to SI and the SI unit of the quantity: `("um") -> (1e-6, "m")`; None where the text is no unit at all."""
    import pint

    text = unit.strip().replace("°", "deg")
    if text in ("m", "rad", "s"):
        return 1.0, text
    try:
        base = _registry().Quantity(1, text).to_base_units()
        return float(f"{base.magnitude:.16g}"), f"{base.units:~}"
    except (pint.errors.PintError, AttributeError, TypeError, ValueError, AssertionError, SyntaxError):
        return None
    except Exception as error:  # the parser of units raises what the tokenizer of the language raises
        if type(error).__module__ == "tokenize":
            return None
        raise


def factor(unit: str, quantities: tuple[str, ...], what: str) -> tuple[float, str]:
    """Factor from `unit` to SI, and which of `quantities` ("m", "rad", "s") it measures.

    Args:
        unit: a unit as written in a header or given by the user.
        quantities: the SI units that fit.
        what: what the unit belongs to, for the message: "the displacement 'x' of run.csv".

    Raises:
        DataError: the text is no unit, or a unit of something else; examples that fit are named.
    """
    fitting = " or ".join(EXAMPLES[quantity] for quantity in quantities)
    found = si_unit(unit)
    if found is None:
        raise DataError(f"'{unit}' is not a known unit, but {what} has it; give one such as {fitting}.")
    scale, quantity = found
    if quantity not in quantities:
        raise DataError(f"The unit '{unit}' does not fit {what}; units that fit are {fitting}.")
    return scale, quantity
