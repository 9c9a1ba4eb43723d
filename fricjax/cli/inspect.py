"""Before a fit: ``fricjax inspect`` says what a record is like, ``fricjax check`` what a planned run will determine."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any, ClassVar

from typer import Argument, Exit, Option

from ..machine import parsing
from .options import Machine, Plot, Reading, Writing
from .output import deliver, prepare, working
from .records import check_records, read_records
from .targets import PICTURES, check_targets, write_picture, write_pictures


def inspect(
    file: Annotated[Path, Argument(help="File with a displacement over time.", show_default=False)],
    reading: Reading,
    output: Writing,
    plot: Plot = None,
) -> None:
    """Show what a record is like: rate, gaps, noise, amplitude, half-cycles, release, rest."""
    check_targets(output, ("--plot", plot, PICTURES))
    check_records([file], reading)
    with working(output, f"Inspecting {file.name}"):
        records = read_records([file], reading)
        # Nothing is computed that takes JAX, so that there is nothing to prepare and little to wait for.
        from ..data import inspect as inspect_record

        inspections = [inspect_record(record) for record in records]
    data: list[dict[str, Any]] = []
    texts: list[str] = []
    for inspection, record in zip(inspections, records, strict=True):
        steps = [str(step) for step in record.log]
        data.append({**inspection.to_dict(), "log": steps})
        report = inspection.report()
        logged = dataclasses.replace(report, facts=[*report.facts, *(("log", step) for step in steps)])
        texts.append(logged.text())
    draw = lambda: write_pictures(output, plot, [record.plot for record in records])
    deliver(output, data[0] if len(data) == 1 else {"runs": data}, "\n\n".join(texts), draw)


@dataclasses.dataclass(frozen=True)
class Planned:
    """The run, and what is to be fitted to it."""

    PANEL: ClassVar = "Planned run"

    x0: Annotated[str, Option("--x0", help='Displacement at release, as 2e-3 or "2 mm".', show_default=False)]
    free: Annotated[
        str | None,
        Option(
            help="Coefficients to be fitted, with their values where --fix does not give them, as mu=0.01,damping. "
            "Default: all that the model has."
        ),
    ] = None
    nuisance: Annotated[str, Option(help="Free parameters of the run: x0,v0,offset,drift,t_release.")] = "x0,offset"
    rate: Annotated[str, Option(help="Samples per second, as 10000 or 10k.")] = "10k"
    duration: Annotated[
        float | None, Option(help="Length of the record, in s; default: until 50 ms after the stop.")
    ] = None
    noise: Annotated[str, Option(help='White noise of one sample, standard deviation, as 1e-9 or "1 nm".')] = "1nm"


def check(run: Planned, machine: Machine, output: Writing, plot: Plot = None) -> None:
    """Say what a planned run will determine and how well; ends with 3 where a coefficient of --free will not be."""
    from ..fitting.names import find_leaf
    from ..fitting.settings import check_nuisance, check_once
    from ..machine.choose import known
    from ..settings import check_noise, check_sampling

    check_targets(output, ("--plot", plot, PICTURES))
    entries = parsing.words(run.free)
    # What has a value with --free has it as with --fix: a run that is only planned has nothing to start from.
    values = [entry for entry in entries if "=" in entry]
    choice = known(dataclasses.replace(machine, fix=[*(machine.fix or []), *values]))
    names = [entry.partition("=")[0].strip() for entry in entries]
    nuisance = parsing.words(run.nuisance)
    leaves = [find_leaf(name, choice.model.leaves).name for name in names]
    for name in nuisance:
        check_nuisance(name)
    check_once([*leaves, *nuisance])
    rate, noise = parsing.per_second("--rate", run.rate), parsing.displacement("--noise", run.noise)
    x0 = parsing.displacement("--x0", run.x0)
    check_sampling(rate, run.duration)
    check_noise(noise)
    with working(output, "Checking"):
        prepare(output)
        from ..sensitivity import fisher

        information = fisher(
            choice.oscillator,
            x0=x0,
            names=None if run.free is None else names,
            rate=rate,
            duration=run.duration,
            noise=noise,
            nuisance=nuisance,
            engine=machine.engine,
        )
    picture = lambda: write_picture(output, plot, information.plot)
    deliver(output, information.to_dict(), information.summary(), picture)
    # Of coefficients that nobody named it is the answer, and no failure, that a run leaves some open.
    if run.free is not None and information.undetermined:
        raise Exit(3)
