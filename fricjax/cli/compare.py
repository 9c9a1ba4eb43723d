"""``fricjax compare``: which friction law describes the runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from .failure import INVALID
from .fit import raise_invalid
from .options import Bench, Plot, Reading, Writing
from .output import PICTURES, check_targets, deliver, working, write_picture
from .records import read_records, tell_doubts
from .runtime import prepare

if TYPE_CHECKING:
    from ..comparison import Comparison
    from ..data import Record
    from .machine import Choice

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
            help="A law to compare, once for each: coulomb, stribeck, lugre; + adds. Default: coulomb and stribeck. "
            "fricjax models lists all laws.",
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
    choices = _choices(files, laws, bench, reading, guess)
    how = _settings(criterion, start, held_out)
    calibrated = choices[0].calibrated
    with working(output, f"Comparing {', '.join(laws)}"):
        records = read_records(files, reading)
        prepare(output)
        tell_doubts(records)
        found = _compared(records, laws, choices, how)
    data: dict[str, Any] = {**found.to_dict(), "calibrated": calibrated}
    best = found.best
    if not best.converged:
        data |= {"error": best.status, "kind": "fit", "exit_code": INVALID}
    deliver(output, data, _report(found, calibrated), lambda: write_picture(output, plot, found.plot))
    if not best.converged:
        raise_invalid(output, best.status)


def _choices(
    files: list[Path], laws: list[str], bench: Bench, reading: Reading, guess: list[str] | None
) -> "list[Choice]":
    """The machine with each of the laws, once the files are known to be there."""
    from ..comparison.names import check_different
    from .files import check_records
    from .machine import contenders

    check_records(files, reading)
    choices = contenders(bench, laws, guess)
    check_different(laws)
    return choices


def _settings(criterion: str, start: str, held_out: bool) -> dict[str, Any]:
    """Keywords of `fricjax.compare`, checked."""
    from ..comparison.names import check_criterion
    from ..fitting.settings import check_start

    check_criterion(criterion, held_out)
    check_start(start)
    return {"criterion": criterion, "start": start, "held_out": held_out}


def _compared(records: "list[Record]", laws: list[str], choices: "list[Choice]", how: dict[str, Any]) -> "Comparison":
    from ..comparison import compare as compare_laws

    oscillators = [choice.oscillator for choice in choices]
    settings = {"engine": choices[0].engine, "rig": choices[0].rig, **how}
    return compare_laws(records, oscillators, [choice.free for choice in choices], names=laws, **settings)


def _report(found: "Comparison", calibrated: bool) -> str:
    """The comparison, and the numbers of the law that comes first; without a rig those that need none."""
    from ..fitting.show import kinematics_table, parameter_table

    table = parameter_table(found.best) if calibrated else kinematics_table(found.best)
    return f"{found.summary()}\n\n{found.ranking[0]}:\n{table.text()}"
