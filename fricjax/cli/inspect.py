"""``fricjax inspect`` and ``fricjax check``: steps before a fit.

`inspect` describes a record. `check` computes the expected standard errors of a planned run.
"""

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
    """Describe a record before a fit.

    The command shows rate, gaps, noise, amplitude, half-cycles, release and rest.
    """
    check_targets(output, ("--plot", plot, PICTURES))
    check_records([file], reading)
    with working(output, f"Inspecting {file.name}"):
        records = read_records([file], reading)
        # This needs no JAX, and therefore no `prepare`.
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
    outcome = data[0] if len(data) == 1 else {"runs": data}
    deliver(output, {"schema": "fricjax.inspect/1", **outcome}, "\n\n".join(texts), draw)


@dataclasses.dataclass(frozen=True)
class Planned:
    """Options for the planned run and its fit."""

    PANEL: ClassVar = "Planned run"

    x0: Annotated[str, Option("--x0", help='Displacement at release, such as 2e-3 or "2 mm".', show_default=False)]
    free: Annotated[
        str | None,
        Option(
            help="Coefficients to fit, with the values that --fix does not give, such as mu=0.01,damping. "
            "Default: all coefficients of the model."
        ),
    ] = None
    nuisance: Annotated[str, Option(help="Free parameters of the run: x0,v0,offset,drift,t_release.")] = "x0,offset"
    rate: Annotated[str, Option(help="Samples per second, such as 10000 or 10k.")] = "10k"
    duration: Annotated[
        float | None, Option(help="Length of the record in s. Default: until 50 ms after the stop.")
    ] = None
    noise: Annotated[str, Option(help='White noise of one sample (standard deviation), such as 1e-9 or "1 nm".')] = (
        "1nm"
    )


def check(run: Planned, machine: Machine, output: Writing, plot: Plot = None) -> None:
    """Compute the expected standard errors of a planned run.

    The exit code is 3 if the run leaves a coefficient of --free undetermined.
    """
    from ..fitting.names import find_leaf
    from ..fitting.settings import check_nuisance, check_once
    from ..machine.choose import known
    from ..settings import check_noise, check_sampling

    check_targets(output, ("--plot", plot, PICTURES))
    entries = parsing.words(run.free)
    # A value in --free means the same as in --fix, because a planned run needs no start value.
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
    deliver(output, {"schema": "fricjax.check/1", **information.to_dict()}, information.summary(), picture)
    # Without --free, undetermined coefficients are a result and not a failure.
    if run.free is not None and information.undetermined:
        raise Exit(3)
