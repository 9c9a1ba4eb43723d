"""``fricjax calibrate``: numbers of the rig and of its interferometer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from ..errors import UsageError
from .failure import InvalidFit
from .options import Output, Reading, Writing, example, grouped
from .output import deliver, finish, prepare, working
from .records import check_records, read_record
from .targets import check_targets

if TYPE_CHECKING:
    from ..rig import Rig
    from ..show import Reported

_RIG = "Rig"
_LIGHT, _AIR = "Light", "Air"

Out = Annotated[
    Path | None, Option("--out", help="Write the rig file (.toml); needs --normal-force.", rich_help_panel="Output")
]
NormalForce = Annotated[
    str | None,
    Option(help='Load on the contact for the rig file, such as 9.66 or "9.66 +/- 0.05 N".', rich_help_panel=_RIG),
]


def ringdown(
    file: Annotated[Path, Argument(help="Free decay without contact.", show_default=False)],
    reading: Reading,
    output: Writing,
    restoring: Annotated[
        str, Option(help="Restoring force: linear, cubic or pendulum.", rich_help_panel=_RIG)
    ] = "linear",
    mass: Annotated[
        str | None, Option(help='Moving mass for the rig file, such as 0.41 or "410.7(3) g".', rich_help_panel=_RIG)
    ] = None,
    normal_force: NormalForce = None,
    out: Out = None,
) -> None:
    """Calibrate a rig from a free decay without contact.

    The results are frequency, damping ratio, quadratic drag and residual friction.
    """
    _check_out(output, out, {"--normal-force": normal_force, "--mass": mass})
    from ..rig.inputs import check_restoring

    check_records([file], reading)
    check_restoring(restoring)
    with working(output, f"Calibrating from {file.name}"):
        record = read_record(file, reading)
        prepare(output)
        from ..calibrate.ringdown import calibrate_ringdown
        from ..fitting.result import FitError

        try:
            calibration = calibrate_ringdown(record, restoring=restoring)
        except FitError as error:
            raise InvalidFit(str(error)) from error
    rig = calibration.rig(mass, normal_force) if out is not None and mass and normal_force else None
    _deliver(output, "fricjax.ringdown/1", calibration, rig, out)


def frf(
    file: Annotated[
        Path, Argument(help="Table of frequency in Hz, and real and imaginary part of X/F in m/N.", show_default=False)
    ],
    output: Writing,
    duration: Annotated[
        float | None,
        Option(help="Length of the record in s. Default: one over the line spacing.", rich_help_panel=_RIG),
    ] = None,
    scale_std: Annotated[
        float, Option(help="Relative standard uncertainty of the force sensor.", rich_help_panel=_RIG)
    ] = 0.0,
    normal_force: NormalForce = None,
    out: Out = None,
) -> None:
    """Find mass, stiffness and damping from a measured receptance.

    The receptance is displacement over force as a function of frequency.
    """
    _check_out(output, out, {"--normal-force": normal_force})
    from ..data.files import check_file

    check_file(file)
    with working(output, f"Calibrating from {file.name}"):
        prepare(output)
        from ..calibrate.frf import calibrate_frf, read_frf

        calibration = calibrate_frf(*read_frf(file), duration=duration, scale_std=scale_std)
    rig = calibration.rig(normal_force) if out is not None and normal_force else None
    _deliver(output, "fricjax.frf/1", calibration, rig, out)


def interferometer(
    output: Output,
    wavelength: Annotated[
        str, Option(help="Wavelength of the laser in vacuum.", rich_help_panel=_LIGHT)
    ] = "632.9908 nm",
    passes: Annotated[
        int, Option(help="Number of times the light travels to the mirror and back: 1 or 2.", rich_help_panel=_LIGHT)
    ] = 1,
    counts: Annotated[float, Option(help="Counts of the electronics per fringe.", rich_help_panel=_LIGHT)] = 1,
    temperature: Annotated[
        str, Option(help='Temperature of the air in degC, such as "20.1(1)".', rich_help_panel=_AIR)
    ] = "20",
    pressure: Annotated[
        str, Option(help='Pressure of the air, such as "1013.2(3) hPa".', rich_help_panel=_AIR)
    ] = "101325 Pa",
    humidity: Annotated[str, Option(help='Relative humidity, such as "45(5) %".', rich_help_panel=_AIR)] = "50 %",
    co2: Annotated[
        str, Option(help='Mole fraction of carbon dioxide, such as "450(50) ppm".', rich_help_panel=_AIR)
    ] = ("450 ppm"),
) -> None:
    """Find the length of one count of an interferometer.

    The refractive index of the air follows Ciddor (1996).
    """
    from ..calibrate.interferometer import calibrate_interferometer

    air = {"temperature": temperature, "pressure": pressure, "humidity": humidity, "co2": co2}
    scale = calibrate_interferometer(wavelength, passes=passes, counts=counts, **air)
    finish(output, {"schema": "fricjax.interferometer/1", **scale.to_dict()}, scale.summary())


def _check_out(output: Writing, out: Path | None, needed: dict[str, str | None]) -> None:
    """Refuse an incomplete rig file before any work is done."""
    check_targets(output, ("--out", out, (".toml",)))
    from ..rig.quantity import quantity

    for option, text in needed.items():
        if text is not None:
            quantity(option.removeprefix("--").replace("-", "_"), text)
    missing = [name for name, value in needed.items() if value is None]
    if out is not None and missing:
        raise UsageError(f"A rig file needs numbers that this calibration does not give: add {' and '.join(missing)}.")


def _deliver(output: Writing, schema: str, calibration: "Reported", rig: "Rig | None", out: Path | None) -> None:
    """Write the rig file if there is one, and show the outcome."""

    def write() -> dict[str, str]:
        return {} if rig is None or out is None else {"rig": str(rig.to_toml(out, overwrite=output.force))}

    deliver(output, {"schema": schema, **calibration.to_dict()}, calibration.summary(), write)


app = typer.Typer(
    name="calibrate",
    help="Calibrate the rig or its interferometer.",
    no_args_is_help=True,
)
app.command("ringdown", epilog=example("calibrate ringdown swing.csv --mass 0.41 --normal-force 9.66 --out rig.toml"))(
    grouped(ringdown)
)
app.command("frf", epilog=example("calibrate frf receptance.csv --normal-force 9.66 --out rig.toml"))(grouped(frf))
app.command("interferometer", epilog=example('calibrate interferometer --passes 2 --pressure "1013.2(3) hPa"'))(
    grouped(interferometer)
)
