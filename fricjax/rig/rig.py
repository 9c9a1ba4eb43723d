"""The rig: what is known of the machine before a run, and how well.

A trace alone tells the natural frequency, the damping ratio and the dead band ``x_d = mu N/k``. To turn the dead band
into a coefficient of friction the load and either the stiffness or the moving mass must come from a calibration, and
their uncertainties go into that of the coefficient: ``mu = omega^2 x_d m/N``.

What no record shows of its instrument is an input too: by how much all displacements and all times may be wrong in
proportion, and how large a periodic nonlinearity may be. Their best estimates are one, one and zero, for a record is
corrected by what is known of it before it is fitted.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..data.files import naming
from ..errors import UsageError, nearest
from ..friction import AbstractFriction
from ..oscillator import Oscillator
from ..oscillator.restoring import AbstractRestoring, Cubic, Linear, Pendulum
from ..show import Report, Reported, Style, Table, axis_label, figure, rotary_unit, styled
from ..show.thumbnail import bars_svg
from .inputs import READING, check_restoring, checked, read_table, replaced, write_table
from .measured import Measured
from .quantity import UNITS

_PERCENTAGE = "Relative standard uncertainty [%]"

type Number = float | Measured | str | Mapping[str, Any]


@dataclasses.dataclass(frozen=True, init=False)
class Rig(Reported):
    """A machine with its calibrated values, each a `Measured`; SI units, for rotary rigs kg m^2, N m/rad, N m.

    Attributes:
        mass: moving mass [kg].
        normal_force: load on the contact [N].
        stiffness: slope of the restoring force at the equilibrium [N/m], or None where the frequency is given.
        frequency: undamped natural frequency [Hz], or None where the stiffness is given.
        damping: viscous coefficient [N s/m]; None: not known, zero is the start value.
        damping_ratio: the same as a fraction of the critical damping [1], or None.
        restoring: form of the restoring force.
        k3: cubic coefficient of a cubic spring [N/m^3], else None.
        drag: quadratic drag coefficient [N s^2/m^2].
        displacement_scale: true over displayed displacement [1], one: its standard uncertainty is that of wavelength,
            refractive index, cosine and Abbe error together, in proportion to the displacement. None: exact.
        time_scale: true over stated time [1], one: with the standard uncertainty of the clock. None: exact.
        periodic_nonlinearity: error of the reading that is a sine of the displacement [m], zero: its standard
            uncertainty is that of the reading, A/sqrt(2) for an amplitude A of unknown phase. None: exact.
        nonlinearity_period: displacement over which it repeats [m], or None without one.

    Examples:
        >>> import fricjax as fj
        >>> rig = fj.Rig(mass="410.7(3) g", frequency="12.600(2) Hz", normal_force=fj.Measured(9.66, 0.05))
        >>> print(rig.summary())
        Rig with linear restoring force
        quantity            value  unit       uncertainty
        ────────────  ───────────  ─────────  ───────────
        mass          0.41070(30)  kg         0.073 %
        frequency     12.6000(20)  Hz         0.016 %
        normal_force    9.660(50)  N          0.52 %
        drag                    0  N s^2/m^2  exact
        >>> print(f"{rig.oscillator(fj.friction.Coulomb(0.02)).stiffness:.1f} N/m")
        2574.1 N/m
        >>> rig.replace(stiffness="2.574 N/mm").frequency is None
        True
    """

    mass: Measured
    normal_force: Measured
    stiffness: Measured | None
    frequency: Measured | None
    damping: Measured | None
    damping_ratio: Measured | None
    restoring: AbstractRestoring
    k3: Measured | None
    drag: Measured
    displacement_scale: Measured | None
    time_scale: Measured | None
    periodic_nonlinearity: Measured | None
    nonlinearity_period: Measured | None

    def __init__(
        self,
        *,
        mass: Number,
        normal_force: Number,
        stiffness: Number | None = None,
        frequency: Number | None = None,
        damping: Number | None = None,
        damping_ratio: Number | None = None,
        restoring: str | AbstractRestoring = "linear",
        k3: Number | None = None,
        drag: Number = 0.0,
        displacement_scale: Number | None = None,
        time_scale: Number | None = None,
        periodic_nonlinearity: Number | None = None,
        nonlinearity_period: Number | None = None,
    ) -> None:
        """Describe a rig.

        Each number is a float in SI units, a `Measured`, a text such as ``"410.7(3) g"``, or a mapping with `value`,
        `std` and `unit`. `restoring` is one of :mod:`fricjax.oscillator.restoring` or its name: linear, cubic (with
        `k3`), pendulum. The scales have the value one and the nonlinearity zero, for only their uncertainties act:
        ``displacement_scale="1 +/- 2e-6"``, ``periodic_nonlinearity="0 +/- 2 nm"``. Where its period is not given, a
        nonlinearity is that of a single-pass interferometer with a helium-neon laser, 316.5 nm.

        Raises:
            UsageError: a value that no rig has, a unit that does not fit, or two values for one thing.
        """
        numbers = {
            "mass": mass,
            "normal_force": normal_force,
            "stiffness": stiffness,
            "frequency": frequency,
            "damping": damping,
            "damping_ratio": damping_ratio,
            "k3": restoring.k3 if isinstance(restoring, Cubic) and k3 is None else k3,
            "drag": drag,
            "displacement_scale": displacement_scale,
            "time_scale": time_scale,
            "periodic_nonlinearity": periodic_nonlinearity,
            "nonlinearity_period": nonlinearity_period,
        }
        if isinstance(restoring, AbstractRestoring):
            name = type(restoring).__name__.lower()
        else:
            check_restoring(restoring)
            name = restoring
            restoring = Pendulum() if name == "pendulum" else Linear()
        values = checked(numbers, name)
        for field, value in values.items():
            object.__setattr__(self, field, value)
        object.__setattr__(self, "restoring", restoring if self.k3 is None else Cubic(self.k3.value))

    @classmethod
    def from_toml(cls, path: str | Path) -> "Rig":
        """The rig described in a TOML file, whose keys are the arguments of `Rig`.

        Raises:
            UsageError: the file is missing or no TOML, or a key or a value does not fit; the sentence names them.
        """
        table = read_table(Path(path))
        with naming(path):
            return cls(**table)

    def to_toml(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the rig to a TOML file in SI units; the file appears complete or not at all.

        Args:
            path: the file.
            overwrite: replace a file that exists.

        Returns:
            The path.

        Raises:
            UsageError: the restoring force is not one that a file can name.
            FileExistsError: there is such a file, and `overwrite` is not given.
            OSError: the file cannot be written, as on a full disk; what was there is as it was.
        """
        return write_table(self.numbers(), type(self.restoring).__name__, Path(path), overwrite=overwrite)

    def oscillator(self, friction: AbstractFriction) -> Oscillator:
        """The rig's oscillator with a friction law; unknown damping starts at zero."""
        value = lambda number: 0.0 if number is None else number.value
        mass = self.mass.value
        stiffness = mass * (2 * math.pi * self.frequency.value) ** 2 if self.frequency else value(self.stiffness)
        ratio = self.damping_ratio
        damping = 2 * ratio.value * (stiffness * mass) ** 0.5 if ratio else value(self.damping)
        load, drag = self.normal_force.value, self.drag.value
        return Oscillator(mass, stiffness, damping, load, friction, restoring=self.restoring, drag=drag)

    def inputs(self) -> dict[str, Measured]:
        """The values that carry an uncertainty, by name: what a combined standard uncertainty is propagated from."""
        return {name: value for name, value in self.numbers().items() if value.std > 0}

    def shifted(self) -> Iterator[tuple["Rig", float]]:
        """The rig with one input after the other larger by its standard uncertainty, for methods of displacements.

        Beside each rig stands what the displacements are then to be multiplied by. Neither the clock nor a periodic
        nonlinearity is among them: the latter scatters a displacement and shows as such.
        """
        for name, number in self.inputs().items():
            if name == "displacement_scale":
                yield self, number.value + number.std
            elif name not in READING:
                yield self.with_inputs({name: number.value + number.std}), 1.0

    def numbers(self) -> dict[str, Measured]:
        """Every value that is known, by name."""
        return {name: value for name in UNITS if (value := getattr(self, name)) is not None}

    def with_inputs(self, values: Mapping[str, Any]) -> "Rig":
        """The rig with other values of its inputs and the same uncertainties.

        Derivatives pass through: ``jax.jvp(lambda b: rig.with_inputs(b).oscillator(law), ...)``.

        Args:
            values: numbers or tracers by name; each name must be one that the rig holds.

        Raises:
            UsageError: a name that the rig does not hold.
        """
        known = self.numbers()
        for name in values:
            if name not in known:
                raise UsageError(f"The rig has no value '{name}'; it holds {', '.join(known)}.{nearest(name, known)}")
        changed = {name: Measured(value, known[name].std) for name, value in values.items()}
        return dataclasses.replace(self, **changed)

    def replace(self, **values: Any) -> "Rig":
        """The rig with some arguments of `Rig` replaced; a stiffness replaces a frequency and the other way round."""
        return dataclasses.replace(self, **replaced(values))

    def report(self) -> Report:
        """One row per calibrated value: its name, value with uncertainty, unit and relative uncertainty."""
        form = type(self.restoring).__name__.lower()
        quantity = "rad" if form == "pendulum" else "m"
        rows = []
        for name, number in self.numbers().items():
            # Of a value of zero no part is uncertain.
            spread = f"{100 * number.relative:.2g} %" if number.value else ""
            rows.append((name, number, rotary_unit(UNITS[name], quantity), spread if number.std > 0 else "exact"))
        table = Table(("quantity", "value", "unit", "uncertainty"), rows, f"Rig with {form} restoring force")
        return Report([table], data={**self.numbers(), "restoring": form})

    def thumbnails(self) -> Sequence[str]:
        parts = self._percentages()
        return [bars_svg(list(parts), list(parts.values()), _PERCENTAGE)] if parts else []

    def plot(self, *, style: Style = "screen") -> Any:
        """Relative standard uncertainties of the calibrated values as bars, the largest on top; a matplotlib figure.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        parts = self._percentages()
        axes[0, 0].barh(list(parts), list(parts.values()))
        axes[0, 0].invert_yaxis()
        axes[0, 0].set_xlabel(axis_label("Relative standard uncertainty", "%"))
        return styled(drawing, style)

    def _percentages(self) -> dict[str, float]:
        """Relative standard uncertainties [%] of what is uncertain and not zero, the largest first."""
        parts = {name: 100 * number.relative for name, number in self.inputs().items() if number.value}
        return dict(sorted(parts.items(), key=lambda part: -part[1]))
