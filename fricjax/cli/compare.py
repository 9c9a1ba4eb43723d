"""``fricjax compare``: which friction law describes the runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from .failure import INVALID
from .fit import raise_invalid
from .options import Bench, Plot, Reading, Writing
from .output import PICTURES, check_targets, deliver, working, write_picture
from .runtime import prepare

if TYPE_CHECKING:
    from ..comparison import Comparison

_COMPARISON = "Comparison"


def compare(
    files: Annotated[list[Path], Argument(help="One run, or several of one machine.", show_default=False)],
    bench: Bench,
    reading: Reading,
    output: Writing,
    friction: Annotated[
        list[str] | None,
        Option(
            metavar="LAW",
            help="A law to compare, once for each: coulomb, stribeck, lugre; + adds. Default: coulomb and stribeck.",
            rich_help_panel=_COMPARISON,
        ),
    ] = None,
    guess: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="Start value of a free coefficient, as v_stribeck=0.005.",
            rich_help_panel=_COMPARISON,
        ),
    ] = None,
    criterion: Annotated[str, Option(help="Rank by bic, aicc or held_out.", rich_help_panel=_COMPARISON)] = "bic",
    start: Annotated[
        str, Option(help="Where the motion starts: first_reversal or release.", rich_help_panel=_COMPARISON)
    ] = "first_reversal",
    held_out: Annotated[
        bool,
        Option("--held-out/--no-held-out", help="Predict runs that were left out.", rich_help_panel=_COMPARISON),
    ] = True,
    plot: Plot = None,
) -> None:
    """Compare friction laws on the same runs: criteria, prediction of held-out runs, tests of the residuals."""
    check_targets(output, ("--plot", plot, PICTURES))
    laws = friction or ["coulomb", "stribeck"]
    with working(output, f"Comparing {', '.join(laws)}"):
        prepare(output)
        found, calibrated = _compared(files, laws, bench, reading, guess, criterion, start, held_out)
    data: dict[str, Any] = {**found.to_dict(), "calibrated": calibrated}
    best = found.best
    if not best.converged:
        data |= {"error": best.status, "kind": "fit", "exit_code": INVALID}
    deliver(output, data, _report(found, calibrated), lambda: write_picture(output, plot, found.plot))
    if not best.converged:
        raise_invalid(output, best.status)


def _compared(
    files: list[Path],
    laws: list[str],
    bench: Bench,
    reading: Reading,
    guess: list[str] | None,
    criterion: str,
    start: str,
    held_out: bool,
) -> "tuple[Comparison, bool]":
    """The comparison, and whether the machine was given."""
    from ..comparison import compare as compare_laws
    from . import machine as building
    from .records import read_records

    choices = building.contenders(bench, laws, guess)
    for choice in choices:
        building.engine(bench.engine, choice.oscillator)
    records = read_records(files, reading)
    found = compare_laws(
        records[0] if len(records) == 1 else records,
        [choice.oscillator for choice in choices],
        [choice.free for choice in choices],
        names=laws,
        held_out=held_out,
        criterion=criterion,
        engine=bench.engine,
        start=start,
        rig=choices[0].rig,
    )
    return found, choices[0].rig is not None


def _report(found: "Comparison", calibrated: bool) -> str:
    """The comparison, and the numbers of the law that comes first; without a rig those that need none."""
    from ..fitting.show import kinematics_table, parameter_table

    table = parameter_table(found.best) if calibrated else kinematics_table(found.best)
    return f"{found.summary()}\n\n{found.ranking[0]}:\n{table.text()}"
