"""``fricjax budget``: which input of the rig adds how much to the uncertainty of a fitted value."""

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
    """What is known of the inputs."""

    PANEL: ClassVar = "Inputs"

    rig: Annotated[Path | None, Option(help="Rig file whose uncertainties count in place of the fit's.")] = None
    name: Annotated[str | None, Option(help="Fitted value: mu, damping, dead_band ... Default: mu.")] = None
    input: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="An input in SI units in place of the rig's, as normal_force='9.66 +/- 0.05 rectangular'.",
        ),
    ] = None
    factor: Annotated[
        list[str] | None,
        Option(
            metavar="NAME:INPUT=VALUE",
            help="A factor of an input with its uncertainty, as arcuate:normal_force='1 +/- 0.001'.",
        ),
    ] = None
    scatter: Annotated[
        str | None,
        Option(help="Scatter of the mean from run to run, as '0 +/- 2e-5, 9 degrees of freedom'."),
    ] = None
    level: Annotated[float, Option(help="Coverage probability of the expanded uncertainty.")] = 0.95
    draws: Annotated[int, Option(help="Draws of the Monte Carlo beside the budget; 0: none.")] = 1_000_000


def budget(
    fit: Annotated[Path, Argument(help="A fit that fricjax fit --out wrote, made with a rig.", show_default=False)],
    inputs: Inputs,
    output: Writing,
    plot: Plot = None,
    latex: Annotated[Path | None, Option(help="Write the table for LaTeX (.tex).", rich_help_panel="Output")] = None,
) -> None:
    """Show the uncertainty budget of a fitted value (GUM), and check it by Monte Carlo (JCGM 101)."""
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
    data = {**report.to_dict(), "monte_carlo": None if check is None else check.to_dict()}
    text = report.text() if check is None else f"{report.text()}\n\n{check.summary()}"

    def write() -> dict[str, str]:
        written = write_picture(output, plot, result.plot)
        if latex is not None:
            from ..show.files import write_text

            written["table"] = str(write_text(latex, result.to_latex() + "\n", overwrite=output.force))
        return written

    deliver(output, data, text, write)


def _factors(texts: list[str] | None) -> list[tuple[str, str, str]]:
    """Name, input and value of each factor.

    Raises:
        UsageError: one that is not of that form.
    """
    factors = []
    for words, value in parsing.pairs("--factor", texts, "arcuate:normal_force='1 +/- 0.001'").items():
        name, colon, of = words.partition(":")
        if not (name and colon and of):
            raise UsageError(f"--factor '{words}' does not say of what: write for example arcuate:normal_force='1(1)'.")
        factors.append((name, of, value))
    return factors


def _with_factors(fit: Any, rig: Any, stated: dict[str, str], factors: list[tuple[str, str, str]]) -> dict[str, Any]:
    """The inputs that have factors, each as the budget of a product."""
    from ..uncertainty import Input, propagate
    from ..uncertainty.fitted import inputs_of

    known, products = inputs_of(fit, rig), dict[str, Any]()
    for name, of, value in factors:
        # A name that is none is refused with those of --input, where the budget is made.
        base = products.get(of) or Input.of(stated.get(of, known.get(of, 1.0)), known[of].unit if of in known else "")
        products[of] = propagate(lambda **values: math.prod(values.values()), {of: base, name: Input.of(value)})
    return products
