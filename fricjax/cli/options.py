"""Options that several commands share.

A command takes a group of options as one argument: a frozen dataclass with one annotated field per option. `grouped`
presents the fields to typer and passes the dataclass to the command. Names, help texts and defaults are therefore the
same in all commands.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args, get_type_hints

from typer import Option

from .wording import options_of, speak


def example(words: str) -> str:
    """Return the line of a help page that shows an example."""
    return f"Example: fricjax {words.strip()}"


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """Replace each dataclass argument of a command by one option per field."""
    parameters = inspect.signature(command).parameters
    groups: dict[str, Any] = {
        name: p.annotation for name, p in parameters.items() if dataclasses.is_dataclass(p.annotation)
    }

    @functools.wraps(command)
    def spread(**values: Any) -> Any:
        # Messages of the package name the options of the command that runs.
        speak(options)
        made = {name: group(**{field: values.pop(field) for field in _fields(group)}) for name, group in groups.items()}
        return command(**values, **made)

    # typer reads the options of a command from its signature.
    shown: list[inspect.Parameter] = []
    for name, parameter in parameters.items():
        shown += _fields(groups[name]).values() if name in groups else [parameter.replace(kind=parameter.KEYWORD_ONLY)]
    options = options_of(shown)
    spread.__signature__ = inspect.Signature(shown)  # type: ignore[attr-defined]
    spread.__annotations__ = {parameter.name: parameter.annotation for parameter in shown}
    return spread


def _fields(group: Any) -> dict[str, inspect.Parameter]:
    """Return the options of a group, assigned to its help panel."""
    hints = get_type_hints(group, include_extras=True)
    parameters = {}
    for field in dataclasses.fields(group):
        for declared in get_args(hints[field.name])[1:]:
            # All options of a group share one panel.
            declared.rich_help_panel = group.PANEL
        default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
        kind = inspect.Parameter.KEYWORD_ONLY
        parameters[field.name] = inspect.Parameter(field.name, kind, default=default, annotation=hints[field.name])
    return parameters


# Each group declares its own option, because an option belongs to one panel.
NOISE_HELP = "Noise model: auto, white, jitter, autoregressive, coloured or floor; auto: chosen from the residuals."


@dataclasses.dataclass(frozen=True)
class Reading:
    """Options for reading a file, named like the arguments of `fricjax.read`."""

    PANEL: ClassVar = "Reading the file"

    column: Annotated[str | None, Option(help="Column, variable or path of the displacement.")] = None
    time: Annotated[str | None, Option(help="Column, variable or path of the time.")] = None
    run: Annotated[
        str | None, Option(help="Run to read from a file with several runs: a number such as 3, or all.")
    ] = None
    unit: Annotated[
        str | None,
        Option(
            help='Unit of the displacement: m, mm, um, nm, rad, deg, or a scale such as "12.5 um/V"; or of a velocity '
            "or an acceleration: rad/s, deg/s, m/s, m/s^2, g."
        ),
    ] = None
    time_unit: Annotated[str | None, Option(help="Unit of the time: s, ms, us ...")] = None
    rate: Annotated[float | None, Option(help="Samples per second, for a file without a time column.")] = None
    sigma: Annotated[
        float | None, Option(help="Noise of one sample (standard deviation), in the displacement's unit.")
    ] = None
    pendulum_length: Annotated[
        str | None,
        Option(help='Length of a pendulum that was filmed from the front, such as "0.42 m"; the column is its x.'),
    ] = None
    sign: Annotated[int | None, Option(help="Use -1 to reverse the direction of the displacement.")] = None
    delimiter: Annotated[str | None, Option(help="Separator of the columns of a text file.")] = None
    decimal: Annotated[str | None, Option(help="Decimal mark of a text file: . or ,")] = None
    comment: Annotated[str | None, Option(help="Character that starts a comment in a text file.")] = None
    skip_rows: Annotated[int | None, Option(help="Rows to skip at the top of a text file.")] = None
    header: Annotated[
        bool | None, Option("--header/--no-header", help="The text file has, or has not, a line of column names.")
    ] = None
    encoding: Annotated[str | None, Option(help="Encoding of a text file.")] = None
    row: Annotated[int | None, Option(help="Row to read from a .mat variable with several rows.")] = None
    cells: Annotated[str | None, Option(help="Cells of a .mat cell array to join, such as 0,1,2.")] = None
    repair: Annotated[
        str | None,
        Option(help='Faults to repair: dropouts, clock, slips, or with a known fringe "dropouts,slips=158.2 nm".'),
    ] = None
    crop: Annotated[str | None, Option(help="Keep only this span of time in s, such as 1:9, 1: or :9.")] = None


@dataclasses.dataclass(frozen=True)
class Bench:
    """Options for the rig, without its friction law."""

    PANEL: ClassVar = "Machine and friction law"

    rig: Annotated[Path | None, Option(help="Rig file (TOML).")] = None
    fix: Annotated[
        list[str] | None,
        Option(metavar="NAME=VALUE", help="Fixed value of a coefficient, such as mu_s=0.02 or v_s=1e-5,k3=2e6."),
    ] = None
    restoring: Annotated[str | None, Option(help="Restoring force: linear, cubic or pendulum.")] = None
    mass: Annotated[str | None, Option(help='Moving mass, such as 0.41 or "410.7(3) g".')] = None
    stiffness: Annotated[str | None, Option(help='Stiffness, such as 2574 or "2.574 N/mm".')] = None
    normal_force: Annotated[str | None, Option(help='Load on the contact, such as 9.66 or "9.66 +/- 0.05 N".')] = None
    drag: Annotated[float | None, Option(help="Quadratic drag in N s^2/m^2; the start value if it is free.")] = None
    engine: Annotated[str, Option(help="Engine: auto, exact, hybrid or smooth.")] = "auto"


@dataclasses.dataclass(frozen=True)
class Machine(Bench):
    """Options for the rig and its friction law."""

    friction: Annotated[
        str,
        Option(
            help="Friction law: coulomb, tanh, stribeck, lugre ... Use + to add laws, as in coulomb+quadraticdrag. "
            "fricjax models lists all laws."
        ),
    ] = "coulomb"


@dataclasses.dataclass(frozen=True)
class Output:
    """Options for the output."""

    PANEL: ClassVar = "Output"

    json: Annotated[bool, Option("--json", help="Print one JSON object on stdout, and no other text.")] = False
    quiet: Annotated[bool, Option("--quiet", help="Print no log on stderr.")] = False
    debug: Annotated[bool, Option("--debug", help="Show the traceback of an unexpected failure.")] = False


@dataclasses.dataclass(frozen=True)
class Writing(Output):
    """Options for the output of a command that writes files."""

    force: Annotated[bool, Option("--force", help="Replace existing files.")] = False


_FILES = Output.PANEL
Plot = Annotated[Path | None, Option(help="Write a picture (.png, .svg, .pdf).", rich_help_panel=_FILES)]
Save = Annotated[Path | None, Option(help="Write the record (.npz, .csv, .h5).", rich_help_panel=_FILES)]
