"""What one unit of a file's numbers is in SI units: by the column's title, by what the caller says, or by a scale.

A caller's unit may hold a factor, for what a converter counts in: `12.5 um/V`, `0.31 nm/count` or `-2 mm`.
"""

import re

from ..errors import DataError
from .header import UNSCALED
from .units import EXAMPLES, factor, si_unit

_SCALE = re.compile(r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)?\s*\*?\s*(?P<unit>.*?)\s*")


def scale_of(
    found: str | None, given: str | None, quantities: tuple[str, ...], what: str, option: str
) -> tuple[float, str]:
    """Factor to SI of a column, and which of `quantities` ("m", "rad", "s") it then measures.

    Args:
        found: the unit in the column's title; None where it names none.
        given: the unit, or the scale, that the caller says; None: that of the title, else the first of `quantities`.
        quantities: the SI units that fit.
        what: what the unit belongs to, for messages: "the displacement 'x' of run.csv".
        option: the caller's name for what he says: "unit" or "time_unit".

    Raises:
        DataError: a unit that is none, one that does not fit, a title in volts or counts without a scale, or a caller
            who contradicts the title.
    """
    if given is None:
        if found is not None and found.lower() in UNSCALED:
            raise DataError(
                f"{_capital(what)} is in {found}, which only a scale makes a displacement or a time; give it as "
                f"{option}='12.5 {_example(quantities)}/{found}'."
            )
        return factor(found or quantities[0], quantities, what)
    scale, quantity, per = _parsed(given, quantities, what)
    if found is None or (per and _plain(per) == _plain(found)):
        return scale, quantity
    if found.lower() in UNSCALED:
        if not per:
            raise DataError(
                f"{_capital(what)} is in {found}; give the scale as {option}='12.5 {_example(quantities)}/{found}', "
                f"where {option}='{given}' was said."
            )
        raise DataError(f"{_capital(what)} is in {found}, but {option}='{given}' is a scale for {per}.")
    known = si_unit(found)
    if known is None or known[1] not in quantities or (known == (scale, quantity) and not per):
        return scale, quantity
    raise DataError(
        f"{_capital(what)} is in {found} by its title, but {option}='{given}' says otherwise: leave {option}= out, or "
        f"mend the title if that is what is wrong."
    )


def _parsed(given: str, quantities: tuple[str, ...], what: str) -> tuple[float, str, str]:
    """Factor, quantity and what it is for ("V" in `12.5 um/V`) of a unit that the caller gives."""
    match = _SCALE.fullmatch(given)
    number, unit = (match["number"], match["unit"]) if match else (None, given)
    unit, _, per = unit.rpartition("/") if unit.rpartition("/")[2].strip().lower() in UNSCALED else (unit, "", "")
    scale, quantity = factor(unit.strip(), quantities, what)
    if number is not None and not float(number):
        raise DataError(f"{_capital(what)} cannot have the scale '{given}', which is zero.")
    return (1.0 if number is None else float(number)) * scale, quantity, per.strip()


def _plain(unit: str) -> str:
    """One spelling for what a converter counts in: "v" for V, Volt and volts, "count" for counts."""
    return re.sub(r"^volt$", "v", unit.lower().removesuffix("s"))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _example(quantities: tuple[str, ...]) -> str:
    return EXAMPLES[quantities[0]].split("'")[3]
