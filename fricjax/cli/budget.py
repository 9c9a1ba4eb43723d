"""``fricjax budget``: uncertainty budget of a fitted value."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated, Any, ClassVar

from typer import Argument, Option

from ..errors import UsageError
from ..machine import parsing
from .options import Plot, Writing
from .output import deliver, prepare, working
from .targets import PICTURES, check_targets, write_picture


@dataclasses.dataclass(frozen=True)
class Inputs:
    """Options for the inputs of the budget."""

    PANEL: ClassVar = "Inputs"

    rig: Annotated[
        Path | None, Option(help="Rig file with the uncertainties to use. Default: those stored in the fit.")
    ] = None
    name: Annotated[str | None, Option(help="Fitted value: mu, damping, dead_band ... Default: mu.")] = None
    input: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="Input that replaces the one of the rig, in SI units: normal_force='9.66 +/- 0.05 rectangular'.",
        ),
    ] = None
    factor: Annotated[
        list[str] | None,
        Option(
            metavar="NAME:INPUT=VALUE",
            help="Factor of an input with its uncertainty, such as arcuate:normal_force='1 +/- 0.001'.",
        ),
    ] = None
    scatter: Annotated[
        str | None,
        Option(help="Scatter of the mean from run to run, such as '0 +/- 2e-5, 9 degrees of freedom'."),
    ] = None
    level: Annotated[float, Option(help="Coverage probability of the expanded uncertainty.")] = 0.95
    draws: Annotated[int, Option(help="Number of Monte Carlo draws that check the budget; 0 skips the check.")] = (
        1_000_000
    )


def budget(
    fit: Annotated[Path, Argument(help="Fit written by fricjax fit --out, made with a rig.", show_default=False)],
    inputs: Inputs,
    output: Writing,
    plot: Plot = None,
    latex: Annotated[Path | None, Option(help="Write the table for LaTeX (.tex).", rich_help_panel="Output")] = None,
) -> None:
    """Show the uncertainty budget of a fitted value.

    The budget follows the GUM. Monte Carlo draws check it (JCGM 101).
    """
    from ..data.files import check_file

    check_targets(output, ("--plot", plot, PICTURES), ("--latex", latex, (".tex",)))
    check_file(fit)
    if not 0 < inputs.level < 1:
        raise UsageError(f"--level must be a probability between 0 and 1 such as 0.95, got {inputs.level:g}.")
    stated, factors = parsing.pairs("--input", inputs.input, "mass=0.4107(3)"), _factors(inputs.factor)
    with working(output, f"Propagating the uncertainties of {fit.name}"):
        prepare(output)
        from ..fitting import load_fit
        from ..rig import Rig
        from ..uncertainty import Input
        from ..uncertainty import budget as budget_of

        loaded = load_fit(fit)
        rig = None if inputs.rig is None else Rig.from_toml(inputs.rig)
        scatter = None if inputs.scatter is None else Input.of(inputs.scatter)
        known: dict[str, Any] = {**stated, **_with_factors(loaded, rig, stated, factors)}
        result = budget_of(loaded, rig, inputs.name, inputs=known, scatter=scatter)
        check = result.monte_carlo(inputs.draws, level=inputs.level) if inputs.draws else None
        report = result.report(inputs.level)
    simulated = None if check is None else check.to_dict()
    data = {"schema": "fricjax.budget/1", **report.to_dict(), "monte_carlo": simulated}
    text = report.text() if check is None else f"{report.text()}\n\n{check.summary()}"

    def write() -> dict[str, str]:
        written = write_picture(output, plot, result.plot)
        if latex is not None:
            from ..show.files import write_text

            written["table"] = str(write_text(latex, result.to_latex() + "\n", overwrite=output.force))
        return written

    deliver(output, data, text, write)


def _factors(texts: list[str] | None) -> list[tuple[str, str, str]]:
    """Return name, input and value of each factor.

    Raises:
        UsageError: a text of another form.
    """
    factors = []
    for words, value in parsing.pairs("--factor", texts, "arcuate:normal_force='1 +/- 0.001'").items():
        name, colon, of = words.partition(":")
        if not (name and colon and of):
            raise UsageError(f"--factor '{words}' names no input: write for example arcuate:normal_force='1(1)'.")
        factors.append((name, of, value))
    return factors


def _with_factors(fit: Any, rig: Any, stated: dict[str, str], factors: list[tuple[str, str, str]]) -> dict[str, Any]:
    """Return the inputs with factors, each as the budget of a product."""
    from ..uncertainty import Input, propagate
    from ..uncertainty.fitted import inputs_of

    known, products = inputs_of(fit, rig), dict[str, Any]()
    for name, of, value in factors:
        # The budget refuses unknown names, together with those of --input.
        base = products.get(of) or Input.of(stated.get(of, known.get(of, 1.0)), known[of].unit if of in known else "")
        products[of] = propagate(lambda **values: math.prod(values.values()), {of: base, name: Input.of(value)})
    return products
