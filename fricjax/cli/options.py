"""The groups of options: how a file is read, which machine is meant, where results go."""

import dataclasses
from pathlib import Path
from typing import Annotated

from typer import Option

_READ, _MODEL, _OUT = "Reading the file", "Machine and friction law", "Output"


@dataclasses.dataclass(frozen=True)
class Reading:
    """How files are read; the names are those of `fricjax.read`."""

    column: Annotated[
        str | None, Option(help="Column, variable or path of the displacement.", rich_help_panel=_READ)
    ] = None
    time: Annotated[str | None, Option(help="Column, variable or path of the time.", rich_help_panel=_READ)] = None
    run: Annotated[
        str | None, Option(help="Which run of a file that holds several, as 3, or all.", rich_help_panel=_READ)
    ] = None
    unit: Annotated[
        str | None,
        Option(
            help='Unit of the displacement: m, mm, um, nm, rad, deg, or a scale as "12.5 um/V".', rich_help_panel=_READ
        ),
    ] = None
    time_unit: Annotated[str | None, Option(help="Unit of the time: s, ms, us ...", rich_help_panel=_READ)] = None
    rate: Annotated[
        float | None, Option(help="Samples per second, for a file without a time.", rich_help_panel=_READ)
    ] = None
    sigma: Annotated[
        float | None,
        Option(help="Noise of one sample (standard deviation), in the displacement's unit.", rich_help_panel=_READ),
    ] = None
    sign: Annotated[int | None, Option(help="-1 turns the direction round.", rich_help_panel=_READ)] = None
    delimiter: Annotated[str | None, Option(help="Between the columns of a text file.", rich_help_panel=_READ)] = None
    decimal: Annotated[str | None, Option(help="Decimal mark of a text file: . or ,", rich_help_panel=_READ)] = None
    comment: Annotated[str | None, Option(help="What begins a comment in a text file.", rich_help_panel=_READ)] = None
    skip_rows: Annotated[int | None, Option(help="Rows to skip at the top of a text file.", rich_help_panel=_READ)] = (
        None
    )
    header: Annotated[
        bool | None, Option("--header/--no-header", help="Whether a text file has names.", rich_help_panel=_READ)
    ] = None
    encoding: Annotated[str | None, Option(help="Encoding of a text file.", rich_help_panel=_READ)] = None
    row: Annotated[int | None, Option(help="Row of a .mat variable with several.", rich_help_panel=_READ)] = None
    cells: Annotated[
        str | None, Option(help="Cells of a .mat cell array to join, as 0,1,2.", rich_help_panel=_READ)
    ] = None
    crop: Annotated[
        str | None, Option(help="Keep only this span of time in s, as 1:9, 1: or :9.", rich_help_panel=_READ)
    ] = None


@dataclasses.dataclass(frozen=True)
class Bench:
    """The rig, whatever its friction law."""

    rig: Annotated[Path | None, Option(help="Rig file (TOML).", rich_help_panel=_MODEL)] = None
    fix: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="Value of a coefficient, as mu_s=0.02 or v_s=1e-5,k3=2e6.",
            rich_help_panel=_MODEL,
        ),
    ] = None
    restoring: Annotated[
        str | None, Option(help="Restoring force: linear, cubic or pendulum.", rich_help_panel=_MODEL)
    ] = None
    mass: Annotated[str | None, Option(help='Moving mass, as 0.41 or "410.7(3) g".', rich_help_panel=_MODEL)] = None
    stiffness: Annotated[str | None, Option(help='Stiffness, as 2574 or "2.574 N/mm".', rich_help_panel=_MODEL)] = None
    normal_force: Annotated[
        str | None, Option(help='Load on the contact, as 9.66 or "9.66 +/- 0.05 N".', rich_help_panel=_MODEL)
    ] = None
    drag: Annotated[
        float | None,
        Option(help="Quadratic drag in N s^2/m^2; a start value where it is free.", rich_help_panel=_MODEL),
    ] = None
    engine: Annotated[str, Option(help="Engine: auto, exact, hybrid or smooth.", rich_help_panel=_MODEL)] = "auto"


@dataclasses.dataclass(frozen=True)
class Machine(Bench):
    """The rig and its friction law."""

    friction: Annotated[
        str,
        Option(
            help="Law: coulomb, tanh, stribeck, lugre ...; + adds, as coulomb+quadraticdrag. see fricjax models.",
            rich_help_panel=_MODEL,
        ),
    ] = "coulomb"


@dataclasses.dataclass(frozen=True)
class Output:
    """How the outcome is told."""

    json: Annotated[
        bool, Option("--json", help="One JSON object on stdout and nothing else.", rich_help_panel=_OUT)
    ] = False
    quiet: Annotated[bool, Option("--quiet", help="No log on stderr.", rich_help_panel=_OUT)] = False
    debug: Annotated[
        bool, Option("--debug", help="Show the traceback of an unexpected failure.", rich_help_panel=_OUT)
    ] = False


@dataclasses.dataclass(frozen=True)
class Writing(Output):
    """How the outcome is told by a command that writes files."""

    force: Annotated[bool, Option("--force", help="Replace files that exist.", rich_help_panel=_OUT)] = False


Plot = Annotated[Path | None, Option(help="Write a picture (.png, .svg, .pdf).", rich_help_panel=_OUT)]
Save = Annotated[Path | None, Option(help="Write the record (.npz, .csv, .h5).", rich_help_panel=_OUT)]
