"""Displacement per count of an interferometer.

It follows from the wavelength in air and from the number of passes of the light.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from ..data.units import Unit, unit_of
from ..errors import UsageError, brief
from ..instrument.air import EQUATION_STD, refractive_index
from ..rig.measured import Measured, positive, propagated
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, parse_uncertain, styled
from ..show.thumbnail import bars_svg

# Unit of each input, SI except for the temperature, and an example for messages.
INPUTS: Mapping[str, tuple[str, str]] = {
    "wavelength": ("m", "632.9908(6) nm"),
    "temperature": ("degC", "20.1(1)"),
    "pressure": ("Pa", "1013.2(3) hPa"),
    "humidity": ("1", "45(5) %"),
    "co2": ("1", "450(50) ppm"),
}


@dataclasses.dataclass(frozen=True)
class InterferometerCalibration(Reported):
    """Displacement per count, with the contributions to its uncertainty.

    Attributes:
        count: displacement of one count [m].
        fringe: displacement of one fringe, ``lambda/(2 passes n)`` [m]; slips of the counter are multiples of it.
        index: refractive index of the air [1].
        contributions: relative standard uncertainty of the count from each input and from the equation [1].
        inputs: measured inputs in SI units, the temperature in degC.

    Examples:
        >>> import fricjax as fj
        >>> scale = fj.calibrate_interferometer("632.9908(6) nm", passes=2, counts=512, pressure="1013.2(3) hPa")
        >>> scale.count, scale.displacement_scale, scale.unit
        (3.0899369(29)e-10, 1.00000000(95), '0.308993691 nm/count')
        >>> rig = fj.Rig(mass=0.41, stiffness=2574.0, normal_force=9.66, displacement_scale=scale.displacement_scale)
    """

    count: Measured
    fringe: Measured
    index: Measured
    contributions: Mapping[str, float]
    inputs: Mapping[str, Measured]

    @property
    def displacement_scale(self) -> Measured:
        """Argument `displacement_scale` of a rig [1].

        It is one, with the relative uncertainty of the count.
        """
        return Measured(1.0, self.count.relative)

    @property
    def unit(self) -> str:
        """Argument `unit` of `fricjax.read`, which converts counts to lengths."""
        return f"{1e9 * self.count.value:.9g} nm/count"

    def report(self) -> Report:
        """Report the inputs, and the settings for rig and records."""
        parts = {name: Cell(f"{1e6 * part:.2g}", contribution=part) for name, part in self.contributions.items()}
        rows = [
            (name, self.inputs.get(name), INPUTS.get(name, ("", ""))[0].strip("1"), part)
            for name, part in parts.items()
        ]
        table = Table(("Input", "Value", "Unit", "Contribution in ppm"), rows, "Scale of an interferometer")
        facts = [
            ("refractive index", repr(self.index)),
            ("fringe", f"{Measured(1e9 * self.fringe.value, 1e9 * self.fringe.std)!r} nm"),
            ("read counts with", f'unit="{self.unit}"'),
            ("repair slips with", f'repair="slips={1e9 * self.fringe.value:.7g} nm"'),
            ("in the rig", f'displacement_scale = "1 +/- {self.count.relative:.2g}"'),
        ]
        data = {**{f.name: getattr(self, f.name) for f in dataclasses.fields(self)}, "unit": self.unit}
        exact = [name for name, each in self.inputs.items() if not each.std]
        named = " and ".join(filter(None, [", ".join(exact[:-1]), *exact[-1:]]))
        warning = f"{named} {'is' if len(exact) == 1 else 'are'} taken as exact; give standard uncertainties too."
        data |= {"displacement_scale": self.displacement_scale}
        return Report([table], facts, warnings=[warning] if exact else [], data=data)

    def _parts(self) -> dict[str, float]:
        """Non-zero contributions in parts per million, the smallest first."""
        parts = {name: 1e6 * part for name, part in self.contributions.items() if part}
        return dict(sorted(parts.items(), key=lambda each: each[1]))

    def thumbnails(self) -> Sequence[str]:
        parts = self._parts()
        return [bars_svg([*parts][::-1], [*parts.values()][::-1], "Relative standard uncertainty of a count [ppm]")]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the contributions to the uncertainty of a count as bars.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure, with the largest contribution on top.
        """
        drawing, axes = figure()
        parts = self._parts() | {"combined": 1e6 * self.count.relative}
        axes[0, 0].barh([*parts], [*parts.values()])
        axes[0, 0].patches[-1].set_color("#D55E00")
        axes[0, 0].set_xlabel(axis_label("Relative standard uncertainty of a count", "ppm"))
        return styled(drawing, style)


def calibrate_interferometer(
    wavelength: Any = 632.9908e-9,
    *,
    passes: int = 1,
    counts: float = 1,
    temperature: Any = 20.0,
    pressure: Any = 101325.0,
    humidity: Any = 0.5,
    co2: Any = 450e-6,
) -> InterferometerCalibration:
    """Calibrate the displacement per count of an interferometer in air.

    The refractive index is computed with Ciddor's equation. Each measured input is a number, a `Measured`, or a text
    such as `"1013.2(3) hPa"`.

    Args:
        wavelength: vacuum wavelength of the laser [m].
        passes: number of round trips of the light to the moving mirror: 1 single pass, 2 double pass.
        counts: counts of the electronics per fringe.
        temperature: temperature of the air [degC].
        pressure: pressure of the air [Pa].
        humidity: relative humidity [1].
        co2: mole fraction of carbon dioxide [1].

    Raises:
        UsageError: a value is not a quantity, or is outside the range of validity of the equation.

    Examples:
        >>> import fricjax as fj
        >>> print(fj.calibrate_interferometer("633 nm", temperature="20.0(1)", humidity="50(5) %").index)
        1.00027137(11)
    """
    if isinstance(passes, bool) or not isinstance(passes, int) or passes < 1:
        raise UsageError(f"passes must be a whole number such as 1 (single pass) or 2 (double pass), got {passes!r}.")
    per_fringe = positive("counts", "1", counts).value
    texts = zip(INPUTS, (wavelength, temperature, pressure, humidity, co2), strict=True)
    inputs = {name: _measured(name, value) for name, value in texts}
    equation = Measured(0.0, EQUATION_STD)

    def index(light: float, t: float, p: float, h: float, carbon: float, error: float) -> float:
        return refractive_index(light, temperature=t, pressure=p, humidity=h, co2=carbon) + error

    def fringe(*values: float) -> float:
        return values[0] / (2 * passes * index(*values))

    known = [*inputs.values(), equation]
    length = propagated(fringe, *known)
    alone = lambda i: [each if i == j else Measured(each.value) for j, each in enumerate(known)]
    names = (*inputs, "equation")
    contributions = {name: propagated(fringe, *alone(i)).relative for i, name in enumerate(names)}
    count = Measured(length.value / per_fringe, length.std / per_fringe)
    return InterferometerCalibration(count, length, propagated(index, *known), contributions, inputs)


def _measured(name: str, value: Any) -> Measured:
    """Convert an input to its unit in `INPUTS`."""
    wanted, example = INPUTS[name]
    if isinstance(value, Measured):
        return value
    if not isinstance(value, str):
        return Measured(value)
    read = parse_uncertain(value)
    if read is None:
        raise UsageError(f'{name} = {brief(value)} is no quantity; write it as "{example}".')
    number, std, unit = read
    if name == "temperature" and unit == "K":
        return Measured(number - 273.15, std)
    known, si = (Unit(1.0, {}) if each in ("", "1") else unit_of(each) for each in (unit or wanted, wanted))
    if known is None or si is None or known.powers != si.powers:
        raise UsageError(f"The unit '{unit}' does not fit {name}; write it as \"{example}\".")
    return Measured(number * known.scale, std * known.scale)
