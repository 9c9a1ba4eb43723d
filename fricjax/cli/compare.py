"""``fricjax compare``: find the friction law that describes the runs."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from typer import Argument, Option

from .options import NOISE_HELP, Bench, Plot, Reading, Writing
from .output import deliver, prepare, working
from .records import check_records, read_records, warn_of_doubts
from .targets import PICTURES, check_targets, write_picture

if TYPE_CHECKING:
    from ..comparison import Comparison


@dataclasses.dataclass(frozen=True)
class Comparing:
    """Options for the comparison."""

    PANEL: ClassVar = "Comparison"

    friction: Annotated[
        list[str] | None,
        Option(
            metavar="LAW",
            help="A law to compare; repeat it for each law: coulomb, stribeck, lugre ... Use + to add laws. "
            "Default: coulomb and stribeck. fricjax models lists all laws.",
        ),
    ] = None
    guess: Annotated[
        list[str] | None,
        Option(metavar="NAME=VALUE", help="Start value of a free coefficient, such as v_stribeck=0.005."),
    ] = None
    criterion: Annotated[str, Option(help="Criterion of the ranking: bic, aicc or held_out.")] = "bic"
    start: Annotated[str, Option(help="Start of the motion: first_reversal or release.")] = "first_reversal"
    noise: Annotated[str, Option(help=NOISE_HELP)] = "auto"
    held_out: Annotated[
        bool,
        Option(
            "--held-out/--no-held-out",
            help="Test, or do not test, how well each law predicts runs left out of the fit.",
        ),
    ] = True


def compare(
    files: Annotated[list[Path], Argument(help="One run, or several of one machine.", show_default=False)],
    comparing: Comparing,
    bench: Bench,
    reading: Reading,
    output: Writing,
    plot: Plot = None,
) -> None:
    """Compare friction laws on the same runs.

    The comparison uses information criteria, the prediction of held-out runs, and tests of the residuals.
    """
    from ..errors import check_choice
    from ..fitting.settings import NOISE_MODELS, check_start
    from ..machine.choose import contenders
    from ..settings import check_criterion, check_different

    check_targets(output, ("--plot", plot, PICTURES))
    laws = comparing.friction or ["coulomb", "stribeck"]
    check_records(files, reading)
    choices = contenders(bench, laws, comparing.guess)
    check_different(laws)
    check_criterion(comparing.criterion, comparing.held_out)
    check_start(comparing.start)
    check_choice("noise model", comparing.noise, NOISE_MODELS)
    calibrated = choices[0].calibrated
    with working(output, f"Comparing {', '.join(laws)}"):
        records = read_records(files, reading)
        prepare(output)
        warn_of_doubts(records)
        from ..comparison import compare as compare_laws

        comparison = compare_laws(
            records,
            [choice.oscillator for choice in choices],
            [choice.free for choice in choices],
            names=laws,
            engine=choices[0].engine,
            rig=choices[0].rig,
            criterion=comparing.criterion,
            start=comparing.start,
            noise=comparing.noise,
            held_out=comparing.held_out,
        )
    data: dict[str, Any] = {"schema": "fricjax.compare/1", **comparison.to_dict(), "calibrated": calibrated}
    failed = "" if comparison.best.described else comparison.best.status
    picture = lambda: write_picture(output, plot, comparison.plot)
    deliver(output, data, _text(comparison, calibrated), picture, failed=failed)


def _text(comparison: "Comparison", calibrated: bool) -> str:
    """Return the comparison and the numbers of the best law.

    Without a rig, these are the numbers that need no rig.
    """
    from ..fitting.show import kinematics_table, parameter_table

    table = parameter_table(comparison.best) if calibrated else kinematics_table(comparison.best)
    return f"{comparison.summary()}\n\n{comparison.ranking[0]}:\n{table.text()}"
