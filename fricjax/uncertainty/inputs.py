"""Inputs of an uncertainty budget: best estimates with their uncertainties.

An uncertainty from the scatter of readings (type A) has degrees of freedom. An uncertainty from a certificate, a
resolution or a judgement (type B) has a distribution (JCGM 100, 4.2 and 4.3). Monte Carlo draws from the distributions
that JCGM 101 assigns in table 1.
"""

import dataclasses
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import UsageError, brief, check_choice
from ..rig.measured import Measured
from ..show import parse_uncertain, uncertain
from ..show.numbers import LONGEST

# Standard deviation of each distribution of half-width one (JCGM 100, 4.3.7 and 4.3.9; JCGM 101, 6.4.6).
_WIDTHS = {"rectangular": 1 / math.sqrt(3), "triangular": 1 / math.sqrt(6), "arcsine": 1 / math.sqrt(2)}
DISTRIBUTIONS = ("normal", *_WIDTHS)
_WORDS = re.compile(
    rf"(?P<number>.*?)(?:,?\s+(?P<shape>{'|'.join(DISTRIBUTIONS)}))?(?:,?\s+(?P<freedom>\d+) degrees? of freedom)?\s*"
)


@dataclasses.dataclass(frozen=True)
class Input:
    """An input quantity of a budget.

    Attributes:
        value: best estimate, in SI units.
        std: standard uncertainty, in the unit of the value; zero: taken as exact.
        unit: SI unit, for the report.
        distribution: distribution of the error: "normal", "rectangular", "triangular" or "arcsine". The last one is
            that of a quantity that oscillates between two ends.
        degrees_of_freedom: degrees of freedom of the standard uncertainty; inf: it is exact, the usual assumption for
            type B. A standard uncertainty with a relative uncertainty r has ``1/(2 r^2)`` (JCGM 100, G.4.2).
        kind: "A" from the scatter of readings, "B" from anything else.

    Raises:
        UsageError: a number is not finite, the uncertainty is negative, there is less than one degree of freedom, or
            the distribution or kind is unknown.

    Examples:
        >>> from fricjax.uncertainty import Input
        >>> load = Input.rectangular(9.66, 0.05, "N")  # a resolution of 0.1 N
        >>> load
        Input(9.660(29) N, rectangular)
        >>> stiffness = Input.of_readings([2571.0, 2574.0, 2577.0], "N/m")
        >>> stiffness, stiffness.degrees_of_freedom
        (Input(2574.0(1.7) N/m, normal, 2 degrees of freedom), 2)
        >>> Input.of("9.66 +/- 0.05 rectangular"), Input.of("2574(3), 9 degrees of freedom")
        (Input(9.660(29), rectangular), Input(2574.0(3.0), normal, 9 degrees of freedom))
    """

    value: float
    std: float
    unit: str = ""
    distribution: str = "normal"
    degrees_of_freedom: float = math.inf
    kind: str = "B"

    def __post_init__(self) -> None:
        number = Measured(self.value, self.std)
        object.__setattr__(self, "value", number.value)
        object.__setattr__(self, "std", number.std)
        check_choice("distribution", self.distribution, DISTRIBUTIONS)
        if self.kind not in ("A", "B"):
            raise UsageError(f"The kind of an input is A or B, got {brief(self.kind)}.")
        if not self.degrees_of_freedom >= 1:
            raise UsageError(f"An input needs at least one degree of freedom, got {self.degrees_of_freedom:g}.")

    @classmethod
    def of(cls, value: Any, unit: str = "") -> "Input":
        """Convert a number, a `Measured`, an input or a text.

        A text is a number with its standard uncertainty in SI units, ``"9.66 +/- 0.05"`` or ``"9.66(5)"``. The words
        ``9 degrees of freedom`` or the name of a distribution may follow. Before the name of a distribution other than
        normal, the uncertainty is the half-width.

        Raises:
            UsageError: the value is anything else.
        """
        if isinstance(value, cls):
            return value
        if not isinstance(value, str):
            number = value if isinstance(value, Measured) else Measured(value)
            return cls(number.value, number.std, unit or number.unit or "")
        words = _WORDS.fullmatch(value) if len(value) <= LONGEST else None
        read = parse_uncertain(words["number"]) if words else None
        if words is None or read is None or read[2]:
            raise UsageError(
                f'{brief(value)} is no number with its uncertainty in SI units, such as "9.66 +/- 0.05", '
                '"9.66 +/- 0.05 rectangular" or "9.66 +/- 0.05, 9 degrees of freedom".'
            )
        shape, freedom = words["shape"] or "normal", float(words["freedom"] or math.inf)
        return cls(read[0], read[1] * _WIDTHS.get(shape, 1.0), unit, shape, freedom)

    @classmethod
    def of_readings(cls, readings: Sequence[float], unit: str = "") -> "Input":
        """Return the mean of independent readings (JCGM 100, 4.2).

        The standard uncertainty is the experimental standard deviation of the mean.

        Raises:
            UsageError: there are fewer than two readings.
        """
        values = np.asarray(readings, float)
        if values.ndim != 1 or values.size < 2:
            raise UsageError(f"A scatter needs two readings at least, got an array of shape {values.shape}.")
        std = float(np.std(values, ddof=1) / math.sqrt(values.size))
        return cls(float(values.mean()), std, unit, degrees_of_freedom=values.size - 1, kind="A")

    @classmethod
    def rectangular(cls, value: float, half_width: float, unit: str = "") -> "Input":
        """Return an input between ``value +/- half_width`` (JCGM 100, 4.3.7)."""
        return cls(value, half_width * _WIDTHS["rectangular"], unit, "rectangular")

    @classmethod
    def triangular(cls, value: float, half_width: float, unit: str = "") -> "Input":
        """Return an input between two ends, most often near the middle.

        JCGM 100, 4.3.9.
        """
        return cls(value, half_width * _WIDTHS["triangular"], unit, "triangular")

    @classmethod
    def arcsine(cls, value: float, half_width: float, unit: str = "") -> "Input":
        """Return an input that oscillates between two ends, e.g. a controlled temperature.

        JCGM 101, 6.4.6.
        """
        return cls(value, half_width * _WIDTHS["arcsine"], unit, "arcsine")

    @property
    def is_normal(self) -> bool:
        """True if the errors are normal, so that they may be correlated."""
        return self.distribution == "normal" and math.isinf(self.degrees_of_freedom)

    def draw(self, generator: np.random.Generator, draws: int) -> np.ndarray:
        """Draw values of the input, shape (draws,)."""
        if self.std == 0:
            return np.full(draws, self.value)
        if self.distribution == "normal":
            # A mean of few readings has Student's distribution, with a larger standard deviation (JCGM 101, 6.4.9.2).
            finite = math.isfinite(self.degrees_of_freedom)
            errors = generator.standard_t(self.degrees_of_freedom, draws) if finite else generator.normal(size=draws)
            return self.value + self.std * errors
        half_width = self.std / _WIDTHS[self.distribution]
        if self.distribution == "rectangular":
            errors = generator.uniform(-1.0, 1.0, draws)
        elif self.distribution == "triangular":
            errors = generator.triangular(-1.0, 0.0, 1.0, draws)
        else:
            errors = np.sin(generator.uniform(-np.pi / 2, np.pi / 2, draws))
        return self.value + half_width * errors

    def __repr__(self) -> str:
        freedom = "" if math.isinf(self.degrees_of_freedom) else f", {self.degrees_of_freedom:g} degrees of freedom"
        return f"Input({uncertain(self.value, self.std, self.unit)}, {self.distribution}{freedom})"
