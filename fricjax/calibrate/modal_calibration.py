"""The result of a modal calibration: five numbers by two methods, and the rig that they make."""

import dataclasses
from collections.abc import Mapping
from html import escape
from typing import Any

from ..rig.measured import Measured
from ..rig.quantity import UNITS
from ..rig.rig import Number, Rig
from ..show.numbers import duration as spoken
from ..show.numbers import uncertain
from ..show.tables import Table
from .peaks import NAMES


@dataclasses.dataclass(frozen=True, eq=False)
class ModalCalibration:
    """A calibrated mode. The standard uncertainties hold the scatter of the lines and that of the receptance's scale.

    Attributes:
        mass: moving mass [kg].
        stiffness: stiffness [N/m].
        damping: viscous coefficient [N s/m].
        frequency: undamped natural frequency [Hz].
        damping_ratio: fraction of the critical damping [1].
        peak_picking: the same five by name, by peak picking.
        residual_compliance: compliance of the modes above the band [m/N].
        noise: standard deviation of the line at the resonance over its size [1].
        duration: length of the record [s].
        warnings: what a reader of the numbers must know, in sentences.
    """

    mass: Measured
    stiffness: Measured
    damping: Measured
    frequency: Measured
    damping_ratio: Measured
    peak_picking: Mapping[str, Measured]
    residual_compliance: Measured
    noise: float
    duration: float
    warnings: tuple[str, ...]

    def rig(self, normal_force: Number, **others: Any) -> Rig:
        """The rig with the calibrated mass, frequency and damping ratio, whose errors are nearly independent.

        Args:
            normal_force: load on the contact [N].
            **others: further arguments of `Rig`, such as `restoring` or `drag`.

        Raises:
            UsageError: a value that no rig has.
        """
        known = {"mass": self.mass, "frequency": self.frequency, "damping_ratio": self.damping_ratio}
        return Rig(**{**known, "normal_force": normal_force, **others})

    def numbers(self) -> dict[str, Measured]:
        """The five results of least squares by name."""
        return {name: getattr(self, name) for name in NAMES}

    def summary(self) -> str:
        """Both methods as a plain table, with the warnings below."""
        return "\n".join([self._table().text(), *(f"! {sentence}" for sentence in self.warnings)])

    def to_dict(self) -> dict[str, Any]:
        """The calibration as plain data."""
        return {
            **{name: dataclasses.asdict(number) for name, number in self.numbers().items()},
            "peak_picking": {name: dataclasses.asdict(number) for name, number in self.peak_picking.items()},
            "residual_compliance": dataclasses.asdict(self.residual_compliance),
            "noise": self.noise,
            "duration": self.duration,
            "warnings": list(self.warnings),
        }

    def _table(self) -> Table:
        rows = [
            (name, uncertain(number.value, number.std), uncertain(picked.value, picked.std), UNITS[name][0])
            for (name, number), picked in zip(self.numbers().items(), self.peak_picking.values(), strict=True)
        ]
        title = f"Modal calibration from a record of {spoken(self.duration)}"
        return Table(("quantity", "least squares", "peak picking", "unit"), rows, title)

    def _repr_html_(self) -> str:
        return self._table().html() + "".join(f"<p>{escape(sentence)}</p>" for sentence in self.warnings)
