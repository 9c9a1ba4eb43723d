"""Result of a ring-down calibration."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..fitting import Fit
from ..rig.measured import Measured, positive, propagated
from ..rig.quantity import quantity
from ..rig.rig import Number, Rig
from ..show import Report, Reported, Style, Table


class Kind(NamedTuple):
    """Title, field and units of a further term of the motion.

    The units are for a linear and a rotary rig.
    """

    title: str
    field: str
    unit: str
    rotary: str


# By their names in a fit. Drag and cubic term are per unit mass, so other tables do not contain their units.
TERMS: Mapping[str, Kind] = {
    "mu": Kind("dead band", "dead_band", "m", "rad"),
    "drag": Kind("quadratic drag", "quadratic_drag", "1/m", ""),
    "k3": Kind("cubic term", "cubic", "N/(m^3 kg)", "1/(rad^2 s^2)"),
}


class Term(NamedTuple):
    """A further term of the motion.

    Attributes:
        name: name in a fit.
        number: value per unit mass; the dead band is not scaled.
        kept: whether the chosen fit includes the term.
    """

    name: str
    number: Measured
    kept: bool

    @property
    def score(self) -> float:
        """Value over standard uncertainty."""
        return self.number.value / self.number.std

    def note(self) -> str:
        """Sentence about an insignificant or negative term, or an empty string."""
        title, distance = TERMS[self.name].title, f"{abs(self.score):.2g} standard uncertainties"
        fate = "kept" if self.kept else "left out"
        if abs(self.score) < thresholds.SUSPECTED:
            return f"The {title} is not significant, {distance} from zero; it was {fate}."
        if self.score < 0 and self.name != "k3":
            return (
                f"The {title} is negative by {distance}, impossible for a passive rig: the model is incomplete. "
                f"It was {fate}."
            )
        return ""


@dataclasses.dataclass(frozen=True, eq=False)
class RingdownCalibration(Reported):
    """Result of a calibration without contact.

    The standard uncertainties allow for residuals that are not white.

    Attributes:
        frequency: undamped natural frequency at small amplitude [Hz].
        damping_ratio: viscous damping as a fraction of the critical damping [1].
        terms: the requested further terms. The values of terms that were left out come from the fit with all terms.
        warnings: warnings, each a sentence or more.
        aicc: Akaike's criterion of each fit, minus that of the chosen one.
        fit: the chosen fit, of a machine of unit mass under unit load.

    Examples:
        >>> import fricjax as fj
        >>> free = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.0))
        >>> record = fj.synthetic_run(free, 2e-3, rate=1000.0, duration=2.0, noise=1e-8, seed=1)
        >>> calibration = fj.calibrate_ringdown(record, drag=False, friction=False)
        >>> rig = calibration.rig(mass="410.0(3) g", normal_force="9.66(5) N")
        >>> rig.mass
        0.41000(30)
        >>> rig.frequency == calibration.frequency
        True
    """

    frequency: Measured
    damping_ratio: Measured
    terms: tuple[Term, ...]
    warnings: tuple[str, ...]
    aicc: Mapping[str, float]
    fit: Fit

    @property
    def dead_band(self) -> Measured | None:
        """Residual dead band F/k of the guides [m]; None: not requested."""
        return self._number("mu")

    @property
    def quadratic_drag(self) -> Measured | None:
        """Quadratic drag per unit mass [1/m]; None: not requested."""
        return self._number("drag")

    @property
    def cubic(self) -> Measured | None:
        """Cubic coefficient k3 per unit mass [N/(m^3 kg)]; None: not requested."""
        return self._number("k3")

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentence for each term that is insignificant or negative."""
        return tuple(note for term in self.terms if (note := term.note()))

    def damping_ratio_at(self, amplitude: Any) -> np.ndarray:
        """Compute the equivalent viscous damping ratio at an amplitude.

        The ratio with the same loss per cycle of a linear spring is ``zeta + 4 d A/(3 pi) + 2 x_d/(pi A)``, with the
        drag d per unit mass and the dead band x_d if they were kept (Jacobsen, 1930).

        Args:
            amplitude: amplitude A [m], any shape.

        Returns:
            The damping ratio [1], of the same shape.
        """
        kept = {term.name: term.number.value for term in self.terms if term.kept}
        a = np.asarray(amplitude, dtype=float)
        quadratic = 4 / (3 * math.pi) * kept.get("drag", 0.0) * a
        return self.damping_ratio.value + quadratic + 2 / math.pi * kept.get("mu", 0.0) / a

    def rig(self, mass: Number, normal_force: Number, **others: Any) -> Rig:
        """Build a rig with the calibrated frequency and damping ratio.

        It includes the quadratic drag and the cubic spring if they were kept.

        Args:
            mass: moving mass [kg].
            normal_force: load on the contact [N].
            **others: further arguments of `Rig`.

        Raises:
            UsageError: a value is impossible.
        """
        moving = positive("mass", "kg", quantity("mass", mass))
        kept = {term.name: term.number for term in self.terms if term.kept and term.name != "mu"}
        scaled = {name: propagated(lambda m, per_mass: m * per_mass, moving, number) for name, number in kept.items()}
        form = type(self.fit.oscillator.restoring).__name__.lower()
        known = {"frequency": self.frequency, "damping_ratio": self.damping_ratio, "restoring": form, **scaled}
        return Rig(**{**known, "mass": moving, "normal_force": normal_force, **others})

    def report(self) -> Report:
        """Report the quantities, with notes and warnings."""
        rotary = self.fit.quantity == "rad"
        rows = [("natural frequency", self.frequency, "Hz", ""), ("damping ratio", self.damping_ratio, "", "")]
        data = {"frequency": self.frequency, "damping_ratio": self.damping_ratio}
        for name, number, kept in self.terms:
            kind = TERMS[name]
            rows.append((kind.title, number, kind.rotary if rotary else kind.unit, "" if kept else "left out"))
            data[kind.field] = number
        title = "Ring-down calibration; quadratic drag and cubic term per unit mass"
        more = {
            "kept": [TERMS[term.name].field for term in self.terms if term.kept],
            "notes": self.notes,
            "warnings": self.warnings,
            "aicc": self.aicc,
        }
        table = Table(("quantity", "value", "unit", "remark"), rows, title)
        return Report([table], notes=self.notes, warnings=self.warnings, data={**data, **more})

    def thumbnails(self) -> Sequence[str]:
        return self.fit.thumbnails()

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the decay with the chosen fit and its residuals.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        return self.fit.plot(style=style)

    def _number(self, name: str) -> Measured | None:
        return next((term.number for term in self.terms if term.name == name), None)
