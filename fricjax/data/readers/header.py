"""What the title of a column says: the name, the unit, and the run that it belongs to.

Programs of laboratories put the unit in brackets (`Time [s]`), behind a slash (`x / mm`), behind an underscore (`x_mm`)
or at the end (`Weg mm`), and the run behind the name (`Position (mm) Run #3`) or in front of it (`Latest: Time (s)`).
"""

import re
from typing import NamedTuple

from ...errors import DataError
from ..units import EXAMPLES, factor, si_unit

# What instruments count in: numbers that are a displacement only by a scale, such as 12.5 um/V.
UNSCALED = frozenset((
    "v", "mv", "uv", "volt", "volts", "a", "ma", "count", "counts", "cts", "cnt", "lsb", "digit", "digits", "step",
    "steps", "pulse", "pulses", "tick", "ticks", "inc", "increment", "increments", "fringe", "fringes", "px", "pixel",
    "pixels", "raw", "adc", "bit", "bits", "a.u.", "arb", "sequence",
))  # fmt: skip
TIME_WORDS = frozenset((
    "t", "time", "times", "timestamp", "timestamps", "zeit", "temps", "tiempo", "tempo", "sec", "secs", "second",
    "seconds", "millis", "micros", "elapsed", "clock", "uhrzeit", "x_value",
))  # fmt: skip
_RUN = re.compile(
    r"[\s_,;(]*(?<![A-Za-z])(?P<word>run|trial|data ?set|shot|messung|lauf|versuch|essai)"
    r"[\s_]*#?[\s_]*(?P<number>\d+)\)?[\s_:]*",
    re.IGNORECASE,
)
_PREFIX = re.compile(r"(?P<run>[^:()\[\]]{1,60}):\s*(?P<rest>\S.*)")
_BRACKETS = re.compile(r"\[([^\[\]]*)\]|\(([^()]*)\)")
# The units that count without a mark, as in `x_mm`: "in", "au" and "h" are rather parts of a name there.
_PLAIN = frozenset((
    "m", "cm", "mm", "um", "µm", "μm", "nm", "pm", "inch", "micron", "microns", "meter", "metre", "meters", "metres",
    "rad", "mrad", "urad", "µrad", "deg", "degree", "degrees", "°", "arcsec", "s", "ms", "us", "µs", "μs", "ns", "sec",
))  # fmt: skip
_COUNTED = {"millis": "ms", "micros": "us", "millis()": "ms", "micros()": "us"}  # clocks of microcontrollers
# A factor and a unit, as `12.5 um/V`.
_SCALE = re.compile(r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)?\s*\*?\s*(?P<unit>.*?)\s*")
_LONGEST = 200  # characters of a title that are read


class Title(NamedTuple):
    """A column's title taken apart; unit and run are None where it names none."""

    name: str
    unit: str | None = None
    run: str | None = None


def split_title(text: str) -> Title:
    """Name, unit and run of a title: `Angle, Ch 1+2 (rad) Run #3` is `("Angle, Ch 1+2", "rad", "Run #3")`.

    Brackets that hold neither a unit nor what a converter counts in stay part of the name, unless they are square.
    """
    text = " ".join(text.strip().strip('"').split())
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    text, unit = _split_unit(text.replace("Âµ", "µ").replace("Â°", "°"))
    text, run = _split_run(text)
    name, unit = (text, unit) if unit else _split_unit(text)
    return Title(name or text, unit or _COUNTED.get(name.lower()) or _as_title(name), run)


def measures(unit: str | None) -> str | None:
    """The SI unit of what a unit of a title measures ("m", "rad", "s", ...); None where it is no unit."""
    known = None if unit is None else si_unit(unit)
    return None if known is None else known[1]


def is_unit(text: str) -> bool:
    """Whether a text is a unit, or what a converter counts in."""
    return text.lower() in UNSCALED or si_unit(text) is not None


def is_time(name: str, unit: str | None) -> bool:
    """Whether a column of this name and unit is a time."""
    kind = measures(unit)
    named = name.lower() in TIME_WORDS or not TIME_WORDS.isdisjoint(_words(name))
    return kind == "s" or (named and (kind is None or unit in ("", None)))


def first_word(name: str) -> str:
    """The first word of a name in small letters: "angle" of "Angle, Ch 1+2"."""
    words = _words(name)
    return words[0] if words else ""


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-zà-ÿ]+", name.lower()) if word]


def _split_run(text: str) -> tuple[str, str | None]:
    """The title without its run, and the run."""
    match = _RUN.search(text)
    if match is not None and (rest := f"{text[: match.start()]} {text[match.end() :]}".strip(" _,:;")):
        return rest, f"{match['word'].capitalize()} {match['number']}"
    match = _PREFIX.fullmatch(text)
    if match is not None and not is_unit(match["rest"]):
        return match["rest"], match["run"].strip()
    return text, None


def _split_unit(text: str) -> tuple[str, str | None]:
    brackets = list(_BRACKETS.finditer(text))
    for match in reversed(brackets):
        content = (match[1] if match[1] is not None else match[2]).strip()
        if is_unit(content) or (match[1] is not None and content and match.end() == len(text)):
            return " ".join(f"{text[: match.start()]} {text[match.end() :]}".split()), content
    if brackets:
        return text, None
    for sign in ("/", " in ", ":", " ", "_"):
        name, mark, unit = text.rpartition(sign)
        if mark and name.strip() and _follows(name.strip(), unit.strip(), marked=sign in "/ in :"):
            return name.strip(" ,"), unit.strip()
    return text, None


def _as_title(name: str) -> str | None:
    """The unit that is the whole title, as oscilloscopes write `Second, Volt`; a letter alone is rather a name."""
    word = name.lower()
    return name if len(word) > 1 and (word in UNSCALED or measures(word) in ("m", "rad")) else None


def _follows(name: str, unit: str, *, marked: bool) -> bool:
    """Whether the last part of a title is a unit: without a mark only one of length or angle, or of a time's name."""
    if marked:
        return is_unit(unit)
    if unit.lower() in _PLAIN:
        return measures(unit) in ("m", "rad") or is_time(name, None)
    return len(unit) > 1 and unit.lower() in UNSCALED


def scale_of(
    titled: str | None, chosen: str | None, quantities: tuple[str, ...], what: str, option: str
) -> tuple[float, str]:
    """Factor to SI of a column, and which of `quantities` ("m", "rad", "s") it then measures.

    Args:
        titled: the unit in the column's title; None where it names none.
        chosen: the unit, or the scale, that the caller says; None: that of the title, else the first of `quantities`.
        quantities: the SI units that fit.
        what: what the unit belongs to, for messages: "the displacement 'x' of run.csv".
        option: the caller's name for what he says: "unit" or "time_unit".

    Raises:
        DataError: a unit that is none, one that does not fit, a title in volts or counts without a scale, or a caller
            who contradicts the title.
    """
    if chosen is None:
        if titled is not None and titled.lower() in UNSCALED:
            raise DataError(
                f"{_capital(what)} is in {titled}, which only a scale makes a displacement or a time; give it as "
                f"{option}='12.5 {_example(quantities)}/{titled}'."
            )
        return factor(titled or quantities[0], quantities, what)
    scale, quantity, per = _parsed(chosen, quantities, what)
    if titled is None or (per and _plain(per) == _plain(titled)):
        return scale, quantity
    if titled.lower() in UNSCALED:
        if not per:
            raise DataError(
                f"{_capital(what)} is in {titled}; give the scale as {option}='12.5 {_example(quantities)}/{titled}', "
                f"where {option}='{chosen}' was said."
            )
        raise DataError(f"{_capital(what)} is in {titled}, but {option}='{chosen}' is a scale for {per}.")
    known = si_unit(titled)
    if known is None or known[1] not in quantities or (known == (scale, quantity) and not per):
        return scale, quantity
    raise DataError(
        f"{_capital(what)} is in {titled} by its title, but {option}='{chosen}' says otherwise: leave {option}= out, "
        f"or mend the title if that is what is wrong."
    )


def _parsed(chosen: str, quantities: tuple[str, ...], what: str) -> tuple[float, str, str]:
    """Factor, quantity and what it is for ("V" in `12.5 um/V`) of a unit that the caller chose."""
    match = _SCALE.fullmatch(chosen)
    number, unit = (match["number"], match["unit"]) if match else (None, chosen)
    unit, _, per = unit.rpartition("/") if unit.rpartition("/")[2].strip().lower() in UNSCALED else (unit, "", "")
    if number is not None and not unit.strip():
        raise DataError(f"'{chosen}' says no unit for {what}; write for example '{chosen} {_example(quantities)}'.")
    scale, quantity = factor(unit.strip(), quantities, what)
    if number is not None and not float(number):
        raise DataError(f"{_capital(what)} cannot have the scale '{chosen}', which is zero.")
    return (1.0 if number is None else float(number)) * scale, quantity, per.strip()


def _plain(unit: str) -> str:
    """One spelling for what a converter counts in: "v" for V, Volt and volts, "count" for counts."""
    return re.sub(r"^volt$", "v", unit.lower().removesuffix("s"))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _example(quantities: tuple[str, ...]) -> str:
    return EXAMPLES[quantities[0]].split("'")[3]
