"""``fricjax fit``: friction coefficients from files of displacement over time."""

import contextlib
import dataclasses
import functools
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from typer import Argument, Option

from ..errors import UsageError
from ..machine import parsing
from .options import NOISE_HELP, Machine, Plot, Reading, Save, Writing
from .output import deliver, prepare, working
from .records import check_records, read_records
from .targets import PICTURES, RECORDS, RESULTS, check_targets, numbered, write_pictures

if TYPE_CHECKING:
    from ..data import Record
    from ..fitting import Fit
    from ..machine.choose import Choice


@dataclasses.dataclass(frozen=True)
class Fitting:
    """Options for the fit."""

    PANEL: ClassVar = "Fit"

    free: Annotated[
        str | None,
        Option(
            help="Free coefficients, with optional start values, such as mu,damping or mu,mu_s=0.02. "
            "Default: mu,damping,stiffness."
        ),
    ] = None
    bounds: Annotated[
        list[str] | None, Option(metavar="NAME=LOW:HIGH", help="Bounds, such as damping=0: or mu=0:0.1.")
    ] = None
    prior: Annotated[
        list[str] | None,
        Option(metavar="NAME=VALUE", help="Prior value with its standard deviation, such as damping=0.175(2)."),
    ] = None
    tie: Annotated[
        list[str] | None, Option(metavar="NAME=NAME", help="Coefficient that follows a free one, such as mu_s=1.3*mu.")
    ] = None
    nuisance: Annotated[str | None, Option(help="Free parameters of the run: x0,v0,offset,drift,t_release.")] = None
    start: Annotated[
        str, Option(help="Start of the fit: first_reversal, release, or seconds from the first sample.")
    ] = "first_reversal"
    guess: Annotated[
        list[str] | None,
        Option(metavar="NAME=VALUE", help="Start value, such as mu=0.012. Default: estimated from the record."),
    ] = None
    loss: Annotated[str, Option(help="Loss: squares; or huber, soft_l1, cauchy, which give outliers less weight.")] = (
        "squares"
    )
    noise: Annotated[str, Option(help=NOISE_HELP)] = "auto"


@dataclasses.dataclass(frozen=True)
class OneFit(Fitting):
    """Options for a single fit."""

    sigma_mode: Annotated[
        str, Option(help="Use of sigma: absolute (as stated), scale (rescaled), or estimate (from the residuals).")
    ] = "absolute"


def fit(
    files: Annotated[list[Path], Argument(help="One run, or several runs for a joint fit.", show_default=False)],
    fitting: OneFit,
    machine: Machine,
    reading: Reading,
    output: Writing,
    plot: Plot = None,
    out: Annotated[Path | None, Option(help="Write the fit (.json).", rich_help_panel="Output")] = None,
    save: Save = None,
) -> None:
    """Fit friction and damping to a free decay.

    Without a rig, the results are natural frequency, damping ratio and dead band.
    """
    pictures = [("--plot", path, PICTURES) for path in numbered(plot, len(files))]
    check_targets(output, *pictures, ("--out", out, RESULTS), ("--save", save, RECORDS))
    if save is not None and len(files) > 1:
        raise UsageError(
            "--save writes one record, but several files were given. Fit them one by one, or leave it out."
        )
    choice, settings = planned(files, fitting, machine, reading)
    with working(output, f"Fitting {', '.join(file.name for file in files)}"):
        records = read_records(files, reading)
        prepare(output)
        result = fitted(choice, settings, records)
    data, text = report(result, choice)
    failed = "" if result.described else result.status
    deliver(output, data, text, lambda: write_outcome(output, result, records, plot, out, save), failed=failed)


def planned(files: list[Path], fitting: OneFit, machine: Machine, reading: Reading) -> "tuple[Choice, dict[str, Any]]":
    """Return the machine and the keywords of `fricjax.fit`.

    The function checks as much as it can without opening the files.

    Raises:
        DataError: files that cannot be read.
        UsageError: names or values that do not fit.
    """
    from ..fitting.settings import check_settings
    from ..machine.choose import choose

    check_records(files, reading)
    settings = {**settings_of(fitting), "sigma_mode": fitting.sigma_mode}
    choice = choose(machine, fitting.free, tuple(settings["tie"]))
    check_settings(choice.model, choice.free, len(files), settings)
    return choice, settings


def fitted(choice: "Choice", settings: dict[str, Any], records: "list[Record]") -> "Fit":
    """Fit the machine to the records."""
    from ..fitting import fit as fit_records

    machine = {"engine": choice.engine, "rig": choice.rig}
    return fit_records(records, choice.oscillator, choice.free, throw=False, **machine, **settings)


def settings_of(fitting: Fitting) -> dict[str, Any]:
    """Return the options as keywords of `fricjax.fit` and `fricjax.fit_batch`."""
    bounds = parsing.pairs("--bounds", fitting.bounds, "damping=0:")
    priors = parsing.pairs("--prior", fitting.prior, "damping=0.175(2)")
    ties = parsing.pairs("--tie", fitting.tie, "mu_s=mu")
    guesses = parsing.pairs("--guess", fitting.guess, "mu=0.012")
    start: str | float = fitting.start
    # The fit refuses a word that is neither a name nor a number.
    with contextlib.suppress(ValueError):
        start = float(start)
    return {
        "nuisance": None if fitting.nuisance is None else parsing.words(fitting.nuisance),
        "start": start,
        "bounds": {name: parsing.span(f"--bounds {name}", text) for name, text in bounds.items()},
        "priors": {name: parsing.estimate(f"--prior {name}", text) for name, text in priors.items()},
        "tie": {name: parsing.tied(text) for name, text in ties.items()},
        "guess": {name: parsing.number(f"--guess {name}", text) for name, text in guesses.items()},
        "loss": fitting.loss,
        "noise": fitting.noise,
    }


def report(fit: "Fit", choice: "Choice") -> tuple[dict[str, Any], str]:
    """Return the fit as data and as text.

    Without a rig, the text shows only numbers that need no rig.
    """
    data = {**_with_numbers(fit.to_dict()), "calibrated": choice.rig is not None}
    if choice.rig is not None:
        return data, fit.summary()
    from ..fitting.show import facts, kinematics_table

    sentences = list(fit.warnings)
    if fit.observation.motion == "rad" and type(fit.oscillator.restoring).__name__ == "Linear":
        sentences.append(
            "The motion is a rotation, but its restoring force was taken as linear: see --restoring pendulum."
        )
    # Without a rig, mu and mu_s belong to a unit mass under unit load.
    lines = [f"{name + ':':<13}{text}" for name, text in facts(fit) if name != "mu_s"]
    lines += [f"! {sentence}" for sentence in sentences]
    hint = "Without a rig there is no mu: give --rig rig.toml, or --mass and --normal-force, to get it."
    return data, "\n\n".join([kinematics_table(fit).text(), "\n".join(lines), hint])


def _with_numbers(value: Any) -> Any:
    """Turn the texts "nan" and "inf" of `Fit.to_dict` into numbers."""
    if isinstance(value, dict):
        return {name: _with_numbers(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_with_numbers(each) for each in value]
    return float(value) if value in ("nan", "inf", "-inf") else value


def write_outcome(
    output: Writing, fit: "Fit", records: "list[Record]", plot: Path | None, out: Path | None, save: Path | None
) -> dict[str, str]:
    """Write the requested files, and return their paths by kind."""
    from ..data import write

    # A motion with NaN or infinity cannot be drawn.
    draws = [functools.partial(fit.plot, i) for i in range(len(records))] if isfinite(fit.residual_rms) else []
    written = write_pictures(output, plot, draws)
    if out is not None:
        written["fit"] = str(fit.save(out, overwrite=output.force))
    if save is not None:
        written["record"] = str(write(records[0], save, overwrite=output.force))
    return written
