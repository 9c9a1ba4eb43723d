"""``fricjax check``: what a planned run will tell, before it is made."""

import dataclasses
from typing import TYPE_CHECKING, Annotated

from typer import Exit, Option

from .options import Machine, Plot, Writing
from .output import PICTURES, check_targets, deliver, working, write_picture
from .runtime import prepare

if TYPE_CHECKING:
    from ..sensitivity import Information

_RUN = "Planned run"


@dataclasses.dataclass(frozen=True)
class Planned:
    """The run, and what is to be fitted to it."""

    x0: Annotated[
        str,
        Option("--x0", help='Displacement at release, as 2e-3 or "2 mm".', rich_help_panel=_RUN, show_default=False),
    ]
    free: Annotated[
        str | None,
        Option(
            help="Coefficients to be fitted, with their values where --fix does not give them, as mu=0.01,damping. "
            "Default: all that the model has.",
            rich_help_panel=_RUN,
        ),
    ] = None
    nuisance: Annotated[
        str, Option(help="Free parameters of the run: x0,v0,offset,drift,t_release.", rich_help_panel=_RUN)
    ] = "x0,offset"
    rate: Annotated[str, Option(help="Samples per second, as 10000 or 10k.", rich_help_panel=_RUN)] = "10k"
    duration: Annotated[
        float | None,
        Option(help="Length of the record, in s; default: until 50 ms after the stop.", rich_help_panel=_RUN),
    ] = None
    noise: Annotated[
        str, Option(help='White noise of one sample, standard deviation, as 1e-9 or "1 nm".', rich_help_panel=_RUN)
    ] = "1nm"


def check(run: Planned, machine: Machine, output: Writing, plot: Plot = None) -> None:
    """Tell what a planned run will determine and how well; ends with 3 where a coefficient of --free will not be."""
    check_targets(output, ("--plot", plot, PICTURES))
    with working(output, "Checking"):
        prepare(output)
        found = checked(run, machine)
    deliver(output, found.to_dict(), found.summary(), lambda: write_picture(output, plot, found.plot))
    if run.free is not None and found.undetermined:
        raise Exit(3)


def checked(run: Planned, machine: Machine) -> "Information":
    """The information of the run that the options plan."""
    from ..sensitivity import fisher
    from . import parsing
    from .machine import engine, known

    entries = parsing.words(run.free)
    given = [entry for entry in entries if "=" in entry]
    oscillator = known(dataclasses.replace(machine, fix=[*(machine.fix or []), *given]))
    engine(machine.engine, oscillator)
    return fisher(
        oscillator,
        parsing.displacement("--x0", run.x0),
        names=None if run.free is None else [entry.partition("=")[0].strip() for entry in entries],
        rate=parsing.per_second("--rate", run.rate),
        duration=run.duration,
        noise=parsing.displacement("--noise", run.noise),
        nuisance=parsing.words(run.nuisance),
        engine=machine.engine,
    )
