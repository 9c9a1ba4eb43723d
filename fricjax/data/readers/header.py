"""Column titles: name, unit and run.

Programs of laboratories put the unit in brackets (`Time [s]`), behind a slash (`x / mm`), behind an underscore (`x_mm`)
or at the end (`Weg mm`), and the run behind the name (`Position (mm) Run #3`) or in front of it (`Latest: Time (s)`).
"""

import functools
import re
from typing import NamedTuple

from ...errors import DataError
from ..units import EXAMPLES, factor, si_unit

# Raw units of instruments: such numbers become a displacement only by a scale, such as 12.5 um/V.
UNSCALED = frozenset((
    "v", "mv", "uv", "volt", "volts", "a", "ma", "count", "counts", "cts", "cnt", "lsb", "digit", "digits", "step",
    "steps", "pulse", "pulses", "tick", "ticks", "inc", "increment", "increments", "fringe", "fringes", "px", "pixel",
    "pixels", "raw", "adc", "bit", "bits", "a.u.", "arb", "sequence",
))  # fmt: skip
TIME_WORDS = frozenset((
    "t", "time", "times", "timestamp", "timestamps", "zeit", "temps", "tiempo", "tempo", "sec", "secs", "second",
    "seconds", "millis", "micros", "elapsed", "clock", "uhrzeit", "x_value",
))  # fmt: skip
_RATES = frozenset((
    "rate", "fs", "samplerate", "samplingrate", "actualrate", "scanrate", "samplingfrequency", "samplefrequency",
))  # fmt: skip
_VELOCITIES = frozenset((
    "velocity", "speed", "vel", "omega", "gyro", "gyroscope", "rotationrate", "geschwindigkeit", "vitesse", "velocità",
))  # fmt: skip
_ACCELERATIONS = frozenset((
    "acceleration", "accel", "acc", "accelerometer", "beschleunigung", "accélération", "accelerazione",
))  # fmt: skip
_RUN = re.compile(
    r"[\s_,;(]*(?<![A-Za-z])(?P<word>run|trial|data ?set|shot|messung|lauf|versuch|essai)"
    r"[\s_]*#?[\s_]*(?P<number>\d+)\)?[\s_:]*",
    re.IGNORECASE,
)
_PREFIX = re.compile(r"(?P<run>[^:()\[\]]{1,60}):\s*(?P<rest>\S.*)")
_BRACKETS = re.compile(r"\[([^\[\]]*)\]|\(([^()]*)\)")
# Units that count without a mark, as in `x_mm`. There "in", "au" and "h" are more likely parts of a name.
_PLAIN = frozenset((
    "m", "cm", "mm", "um", "µm", "μm", "nm", "pm", "inch", "micron", "microns", "meter", "metre", "meters", "metres",
    "rad", "mrad", "urad", "µrad", "deg", "degree", "degrees", "°", "arcsec", "s", "ms", "us", "µs", "μs", "ns", "sec",
))  # fmt: skip
_COUNTED = {"millis": "ms", "micros": "us", "millis()": "ms", "micros()": "us"}  # clocks of microcontrollers
# A factor and a unit, as `12.5 um/V`.
_SCALE = re.compile(r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)?\s*\*?\s*(?P<unit>.*?)\s*")
_LONGEST = 200  # longest part of a title that is read [characters]


class Title(NamedTuple):
    """The parts of a column title; unit and run may be None."""

    name: str
    unit: str | None = None
    run: str | None = None


def split_title(text: str) -> Title:
    """Split a title into name, unit and run.

    `Angle, Ch 1+2 (rad) Run #3` gives `("Angle, Ch 1+2", "rad", "Run #3")`. Round brackets without a unit or a raw unit
    stay part of the name.
    """
    text = " ".join(text.strip().strip('"').split())
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    text, unit = _split_unit(text.replace("Âµ", "µ").replace("Â°", "°"))
    text, run = _split_run(text)
    name, unit = (text, unit) if unit else _split_unit(text)
    return Title(name or text, unit or _COUNTED.get(name.lower()) or _as_title(name), run)


@functools.lru_cache
def measures(unit: str | None) -> str | None:
    """Return the SI unit of a unit, None if unknown.

    Examples are "m", "rad" and "s".
    """
    known = None if unit is None else si_unit(unit)
    return None if known is None else known[1]


def is_unit(text: str) -> bool:
    """Return True if a text is a unit or a raw unit."""
    return text.lower() in UNSCALED or si_unit(text) is not None


def is_time(name: str, unit: str | None) -> bool:
    """Return True if name and unit are those of a time."""
    kind = measures(unit)
    named = name.lower() in TIME_WORDS or not TIME_WORDS.isdisjoint(_words(name))
    return kind == "s" or (named and (kind is None or unit in ("", None)))


def names_rate(name: str) -> bool:
    """Return True for the name of a sample rate, such as "ActualRate"."""
    last = re.split(r"[/.]", name)[-1]
    return re.sub(r"[^a-z]", "", last.lower()) in _RATES


def rate_of_change(name: str, unit: str | None) -> str | None:
    """Return "velocity" or "acceleration" if name or unit are those of one.

    A column with a unit is judged by its unit only.
    """
    if unit is not None and unit.strip():
        if unit.strip() in ("g", "mg") and not _ACCELERATIONS.isdisjoint(_words(name)):
            return "acceleration"
        symbol = measures(unit) or ""
        powers = [symbol == f"{quantity} s^{power}" for power in (-1, -2) for quantity in ("m", "rad")]
        return "velocity" if any(powers[:2]) else "acceleration" if any(powers[2:]) else None
    words = _words(name)
    if not _ACCELERATIONS.isdisjoint(words):
        return "acceleration"
    return None if _VELOCITIES.isdisjoint(words) else "velocity"


def first_word(name: str) -> str:
    """Return the first word in lower case: "angle" of "Angle, Ch 1+2"."""
    words = _words(name)
    return words[0] if words else ""


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-zà-ÿ]+", name.lower()) if word]


def _split_run(text: str) -> tuple[str, str | None]:
    """Split a title into the rest and the run."""
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
    """Return the unit if it is the whole title.

    Oscilloscopes write such titles: `Second, Volt`. A single letter is more likely a name.
    """
    word = name.lower()
    return name if len(word) > 1 and (word in UNSCALED or measures(word) in ("m", "rad")) else None


def _follows(name: str, unit: str, *, marked: bool) -> bool:
    """Return True if the last part of a title is a unit.

    Without a mark only units of length or angle count, and units of time after the name of a time.
    """
    if marked:
        return is_unit(unit)
    if unit.lower() in _PLAIN:
        return measures(unit) in ("m", "rad") or is_time(name, None)
    return len(unit) > 1 and unit.lower() in UNSCALED


def scale_of(
    titled: str | None, chosen: str | None, quantities: tuple[str, ...], subject: str, option: str
) -> tuple[float, str]:
    """Return the factor of a column to SI, and its quantity.

    The quantity is the member of `quantities` ("m", "rad", "s") that the column then measures.

    Args:
        titled: the unit in the column's title; None without one.
        chosen: the unit or scale from the caller; None: use that of the title, else the first of `quantities`.
        quantities: the SI units that fit.
        subject: the quantity with this unit, for messages: "the displacement 'x' of run.csv".
        option: name of the caller's option: "unit" or "time_unit".

    Raises:
        DataError: an unknown unit, one that does not fit, a title in volts or counts without a scale, or an option that
            contradicts the title.
    """
    if chosen is None:
        if titled is not None and titled.lower() in UNSCALED:
            raise DataError(
                f"{_capital(subject)} is in {titled}, which only a scale makes a displacement or a time; give it as "
                f"{option}='12.5 {_example(quantities)}/{titled}'."
            )
        return factor(titled or quantities[0], quantities, subject)
    scale, quantity, per = _parsed(chosen, quantities, subject)
    if titled is None or (per and _plain(per) == _plain(titled)):
        return scale, quantity
    if titled.lower() in UNSCALED:
        if not per:
            raise DataError(
                f"{_capital(subject)} is in {titled}; give the scale as "
                f"{option}='12.5 {_example(quantities)}/{titled}' instead of {option}='{chosen}'."
            )
        raise DataError(f"{_capital(subject)} is in {titled}, but {option}='{chosen}' is a scale for {per}.")
    known = si_unit(titled)
    if known is None or known[1] not in quantities or (known == (scale, quantity) and not per):
        return scale, quantity
    raise DataError(
        f"{_capital(subject)} is in {titled} by its title, but {option}='{chosen}' contradicts it: leave {option}= "
        "out, or correct the title if it is wrong."
    )


def _parsed(chosen: str, quantities: tuple[str, ...], subject: str) -> tuple[float, str, str]:
    """Parse a unit or scale into factor, quantity and raw unit.

    The raw unit is "V" in `12.5 um/V`.
    """
    match = _SCALE.fullmatch(chosen)
    number, unit = (match["number"], match["unit"]) if match else (None, chosen)
    unit, _, per = unit.rpartition("/") if unit.rpartition("/")[2].strip().lower() in UNSCALED else (unit, "", "")
    if number is not None and not unit.strip():
        example = _example(quantities)
        raise DataError(f"'{chosen}' has no unit for {subject}; write for example '{chosen} {example}'.")
    scale, quantity = factor(unit.strip(), quantities, subject)
    if number is not None and not float(number):
        raise DataError(f"{_capital(subject)} cannot have the scale '{chosen}', which is zero.")
    return (1.0 if number is None else float(number)) * scale, quantity, per.strip()


def _plain(unit: str) -> str:
    """Normalise a raw unit: "v" for V, Volt, volts; "count" for counts."""
    return re.sub(r"^volt$", "v", unit.lower().removesuffix("s"))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _example(quantities: tuple[str, ...]) -> str:
    return EXAMPLES[quantities[0]].split("'")[3]
