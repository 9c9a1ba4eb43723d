"""The rig: calibrated values of the machine, with standard uncertainties.

A trace alone determines the natural frequency, the damping ratio and the dead band ``x_d = mu N/k``. The coefficient of
friction, ``mu = omega^2 x_d m/N``, also needs the load and either the stiffness or the moving mass from a calibration.
Their uncertainties contribute to that of the coefficient.

The rig also has inputs for errors of the instrument that a record does not show: the relative errors of all
displacements and of all times, and a periodic nonlinearity. Their best estimates are one, one and zero, because known
corrections are applied to the record before the fit.
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
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, rotary_unit, styled
from ..show.thumbnail import bars_svg
from .inputs import READING, check_restoring, checked, read_table, replaced, write_table
from .measured import Measured
from .quantity import UNITS

_PERCENTAGE = "Relative standard uncertainty [%]"

type Number = float | Measured | str | Mapping[str, Any]


@dataclasses.dataclass(frozen=True, init=False)
class Rig(Reported):
    """A machine with calibrated values.

    Each value is a `Measured` in SI units. For rotary rigs the units are kg m^2, N m/rad and N m.

    Attributes:
        mass: moving mass [kg].
        normal_force: load on the contact [N].
        stiffness: slope of the restoring force at the equilibrium [N/m], or None if the frequency is given.
        frequency: undamped natural frequency [Hz], or None if the stiffness is given.
        damping: viscous coefficient [N s/m]; None: unknown, with zero as the start value.
        damping_ratio: the same as a fraction of the critical damping [1], or None.
        restoring: form of the restoring force.
        k3: cubic coefficient of a cubic spring [N/m^3], else None.
        drag: quadratic drag coefficient [N s^2/m^2].
        displacement_scale: true over displayed displacement [1]. The value is one. The relative standard uncertainty
            combines wavelength, refractive index, cosine and Abbe error. None: exact.
        time_scale: true over stated time [1]. The value is one, the standard uncertainty is that of the clock. None:
            exact.
        periodic_nonlinearity: sinusoidal error of the reading as a function of the displacement [m]. The value is zero,
            the standard uncertainty is A/sqrt(2) for an amplitude A of unknown phase. None: exact.
        nonlinearity_period: period of this error [m], or None.

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
        `k3`), pendulum. The scales must have the value one and the nonlinearity zero, because only their uncertainties
        have an effect: ``displacement_scale="1 +/- 2e-6"``, ``periodic_nonlinearity="0 +/- 2 nm"``. The default period
        of the nonlinearity is that of a single-pass interferometer with a helium-neon laser, 316.5 nm.

        Raises:
            UsageError: a value is impossible, a unit does not fit, or two values describe the same quantity.
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
        """Read a rig from a TOML file.

        The keys of the file are the arguments of `Rig`.

        Raises:
            UsageError: the file is missing or is not TOML, or a key or a value is invalid; the message names them.
        """
        table = read_table(Path(path))
        with naming(path):
            return cls(**table)

    def to_toml(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the rig to a TOML file in SI units, atomically.

        Args:
            path: the file.
            overwrite: replace an existing file.

        Returns:
            The path.

        Raises:
            UsageError: the restoring force has no name in a file.
            FileExistsError: the file exists, and `overwrite` is False.
            OSError: the file cannot be written, as on a full disk; an existing file is unchanged.
        """
        return write_table(self.numbers(), type(self.restoring).__name__, Path(path), overwrite=overwrite)

    def oscillator(self, friction: AbstractFriction) -> Oscillator:
        """Build the oscillator with a friction law; unknown damping is zero."""
        value = lambda number: 0.0 if number is None else number.value
        mass = self.mass.value
        stiffness = mass * (2 * math.pi * self.frequency.value) ** 2 if self.frequency else value(self.stiffness)
        ratio = self.damping_ratio
        damping = 2 * ratio.value * (stiffness * mass) ** 0.5 if ratio else value(self.damping)
        load, drag = self.normal_force.value, self.drag.value
        return Oscillator(mass, stiffness, damping, load, friction, restoring=self.restoring, drag=drag)

    def inputs(self) -> dict[str, Measured]:
        """Values with an uncertainty, by name.

        They are the inputs of a combined standard uncertainty.
        """
        return {name: value for name, value in self.numbers().items() if value.std > 0}

    def shifted(self) -> Iterator[tuple["Rig", float]]:
        """Yield the rig with each input increased by its uncertainty in turn.

        Methods that use displacements alone propagate uncertainties with these rigs. Each rig comes with a factor for
        the displacements. The clock and the periodic nonlinearity are not included; the latter appears as scatter of
        the displacements.
        """
        for name, number in self.inputs().items():
            if name == "displacement_scale":
                yield self, number.value + number.std
            elif name not in READING:
                yield self.with_inputs({name: number.value + number.std}), 1.0

    def numbers(self) -> dict[str, Measured]:
        """Known values by name."""
        return {name: value for name in UNITS if (value := getattr(self, name)) is not None}

    def with_inputs(self, values: Mapping[str, Any]) -> "Rig":
        """Return the rig with other values and the same uncertainties.

        JAX can differentiate through it: ``jax.jvp(lambda b: rig.with_inputs(b).oscillator(law), ...)``.

        Args:
            values: numbers or tracers by name, for values that the rig has.

        Raises:
            UsageError: the rig has no value of this name.
        """
        known = self.numbers()
        for name in values:
            if name not in known:
                raise UsageError(f"The rig has no value '{name}'; it holds {', '.join(known)}.{nearest(name, known)}")
        changed = {name: Measured(value, known[name].std) for name, value in values.items()}
        return dataclasses.replace(self, **changed)

    def replace(self, **values: Any) -> "Rig":
        """Return the rig with some arguments of `Rig` replaced.

        A stiffness replaces a frequency and vice versa.
        """
        return dataclasses.replace(self, **replaced(values))

    def report(self) -> Report:
        """Report each calibrated value with unit and uncertainties."""
        form = type(self.restoring).__name__.lower()
        quantity = "rad" if form == "pendulum" else "m"
        rows = []
        for name, number in self.numbers().items():
            # A value of zero has no relative uncertainty.
            spread = f"{100 * number.relative:.2g} %" if number.value else ""
            relative = Cell(spread if number.std > 0 else "exact", relative_std=number.relative)
            rows.append((name, number, rotary_unit(UNITS[name], quantity), relative))
        table = Table(("quantity", "value", "unit", "uncertainty"), rows, f"Rig with {form} restoring force")
        return Report([table], data={**self.numbers(), "restoring": form})

    def thumbnails(self) -> Sequence[str]:
        parts = self._percentages()
        return [bars_svg(list(parts), list(parts.values()), _PERCENTAGE)] if parts else []

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot relative standard uncertainties as bars, the largest on top.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure()
        parts = self._percentages()
        axes[0, 0].barh(list(parts), list(parts.values()))
        axes[0, 0].invert_yaxis()
        axes[0, 0].set_xlabel(axis_label("Relative standard uncertainty", "%"))
        return styled(drawing, style)

    def _percentages(self) -> dict[str, float]:
        """Relative standard uncertainties [%], the largest first.

        Values without an uncertainty, and values of zero, are left out.
        """
        parts = {name: 100 * number.relative for name, number in self.inputs().items() if number.value}
        return dict(sorted(parts.items(), key=lambda part: -part[1]))
