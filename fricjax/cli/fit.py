"""``fricjax fit``: the main job, from files of displacement over time to friction coefficients with uncertainties."""

import dataclasses
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from .failure import INVALID, InvalidFit
from .options import Machine, Output, Plot, Reading, Save, Writing
from .output import PICTURES, RECORDS, RESULTS, check_targets, deliver, numbered, working
from .records import read_records
from .runtime import prepare

if TYPE_CHECKING:
    from ..data import Record
    from ..fitting import Fit
    from .machine import Choice

_FIT = "Fit"


@dataclasses.dataclass(frozen=True)
class Fitting:
    """What is fitted, and how."""

    free: Annotated[
        str | None,
        Option(
            help="Free coefficients, with start values where wanted, as mu,damping or mu,mu_s=0.02. "
            "Default: mu,damping,stiffness.",
            rich_help_panel=_FIT,
        ),
    ] = None
    bounds: Annotated[
        list[str] | None,
        Option(metavar="NAME=LOW:HIGH", help="Bounds, as damping=0: or mu=0:0.1.", rich_help_panel=_FIT),
    ] = None
    prior: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="Prior knowledge with its standard deviation, as damping=0.175(2).",
            rich_help_panel=_FIT,
        ),
    ] = None
    tie: Annotated[
        list[str] | None,
        Option(metavar="NAME=NAME", help="Coefficient that follows a free one, as mu_s=1.3*mu.", rich_help_panel=_FIT),
    ] = None
    nuisance: Annotated[
        str | None, Option(help="Free parameters of the run: x0,v0,offset,drift,t_release.", rich_help_panel=_FIT)
    ] = None
    start: Annotated[
        str, Option(help="first_reversal, release, or seconds from the first sample.", rich_help_panel=_FIT)
    ] = "first_reversal"
    sigma_mode: Annotated[
        str,
        Option(help="absolute: believe the noise; scale: rescale it; estimate: from residuals.", rich_help_panel=_FIT),
    ] = "absolute"
    guess: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="Start value in place of the one found in the record, as mu=0.012.",
            rich_help_panel=_FIT,
        ),
    ] = None
    loss: Annotated[
        str, Option(help="squares, or huber, soft_l1, cauchy: outliers count for less.", rich_help_panel=_FIT)
    ] = "squares"


def fit(
    files: Annotated[list[Path], Argument(help="One run, or several for a joint fit.", show_default=False)],
    fitting: Fitting,
    machine: Machine,
    reading: Reading,
    output: Writing,
    plot: Plot = None,
    out: Annotated[Path | None, Option(help="Write the fit (.json).", rich_help_panel="Output")] = None,
    save: Save = None,
) -> None:
    """Fit friction and damping to a free decay. Without a rig: natural frequency, damping ratio and dead band."""
    pictures = [("--plot", path, PICTURES) for path in numbered(plot, len(files))]
    check_targets(output, *pictures, ("--out", out, RESULTS), ("--save", save, RECORDS))
    if save is not None and len(files) > 1:
        from ..errors import UsageError

        raise UsageError(
            "--save writes one record, but several files were given. Fit them one by one, or leave it out."
        )
    asked = Asked.of(files, fitting, machine, reading)
    with working(output, f"Fitting {', '.join(file.name for file in files)}"):
        records = read_records(files, reading)
        prepare(output)
        found = fitted(asked, records)
    data, text = report(found, asked.choice)
    if not found.converged:
        data |= {"error": found.status, "kind": "fit", "exit_code": INVALID}
    deliver(output, data, text, lambda: write_outcome(found, records, plot, out, save, output.force))
    if not found.converged:
        raise_invalid(output, found.status)


def raise_invalid(output: Output, status: str) -> None:
    """End with the code of a fit that has not converged; with JSON the one object has been written already."""
    if output.json:
        from typer import Exit

        raise Exit(INVALID)
    raise InvalidFit(f"The fit has not converged, {status} Its results are marked so.")


@dataclasses.dataclass(frozen=True)
class Asked:
    """A fit as asked for, of which everything has been checked that needs no look into the files.

    Attributes:
        choice: the machine.
        settings: the keywords of `fricjax.fit`.
    """

    choice: "Choice"
    settings: dict[str, Any]

    @classmethod
    def of(cls, files: list[Path], fitting: Fitting, machine: Machine, reading: Reading) -> "Asked":
        """What the options ask for.

        Raises:
            DataError: files that cannot be read.
            UsageError: names or values that do not fit.
        """
        from .files import check_records

        check_records(files, reading)
        from ..fitting.settings import check_settings
        from .machine import choose

        settings = _settings(fitting)
        choice = choose(machine, fitting.free, tuple(settings["tie"]))
        check_settings(choice.model, choice.free, len(files), settings)
        return cls(choice, settings)


def fitted(asked: Asked, records: "list[Record]") -> "Fit":
    """Build the machine, and fit it to the records."""
    from ..fitting import fit as fit_records

    choice, oscillator = asked.choice, asked.choice.oscillator
    settings = {"engine": choice.engine, "rig": choice.rig, **asked.settings}
    return fit_records(records, oscillator, choice.free, throw=False, **settings)


def _settings(fitting: Fitting) -> dict[str, Any]:
    """The keywords of `fricjax.fit` that the options stand for."""
    from . import parsing

    bounds = parsing.pairs("--bounds", fitting.bounds, "damping=0:")
    priors = parsing.pairs("--prior", fitting.prior, "damping=0.175(2)")
    ties = parsing.pairs("--tie", fitting.tie, "mu_s=mu")
    guesses = parsing.pairs("--guess", fitting.guess, "mu=0.012")
    named = fitting.start in ("first_reversal", "release") or not _is_number(fitting.start)
    return {
        "nuisance": None if fitting.nuisance is None else parsing.words(fitting.nuisance),
        "start": fitting.start if named else float(fitting.start),
        "bounds": {name: parsing.span(f"--bounds {name}", text) for name, text in bounds.items()},
        "priors": {name: parsing.estimate(f"--prior {name}", text) for name, text in priors.items()},
        "tie": {name: parsing.tied(text) for name, text in ties.items()},
        "sigma_mode": fitting.sigma_mode,
        "guess": {name: parsing.number(f"--guess {name}", text) for name, text in guesses.items()},
        "loss": fitting.loss,
    }


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def report(found: "Fit", choice: "Choice") -> tuple[dict[str, Any], str]:
    """The fit as data and as text; without a rig what is said of it needs none."""
    data = {**found.to_dict(), "calibrated": choice.rig is not None}
    if choice.rig is not None:
        return data, found.summary()
    from ..fitting.show import facts, kinematics_table

    lines = [f"{name + ':':<13}{text}" for name, text in facts(found) if name != "mu_s"]
    lines += [f"! {sentence}" for sentence in (*found.warnings, *_doubts(found))]
    hint = "Without a rig there is no mu: give --rig rig.toml, or --mass and --normal-force, to get it."
    return data, "\n\n".join([kinematics_table(found).text(), "\n".join(lines), hint])


def _doubts(found: "Fit") -> list[str]:
    """What a machine that nobody described may have wrong."""
    if found.quantity == "rad" and type(found.oscillator.restoring).__name__ == "Linear":
        return ["The record is an angle, but its restoring force was taken as linear: see --restoring pendulum."]
    return []


def write_outcome(
    found: "Fit", records: "list[Record]", plot: Path | None, out: Path | None, save: Path | None, force: bool
) -> dict[str, str]:
    """Write the files that were asked for and return them by what they are."""
    from ..data import write
    from ..show import save as save_picture

    written: dict[str, str] = {}
    # A motion that is not finite cannot be drawn.
    if isfinite(found.residual_rms):
        for i, path in enumerate(numbered(plot, len(records))):
            name = "picture" if len(records) == 1 else f"picture_{i + 1}"
            written[name] = str(save_picture(found.plot(i), path, overwrite=force))
    if out is not None:
        written["fit"] = str(found.save(out, overwrite=force))
    if save is not None:
        written["record"] = str(write(records[0], save, overwrite=force))
    return written
