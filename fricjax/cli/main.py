"""The entry point of ``fricjax``: the list of commands, and one place where every failure becomes a sentence.

Exit codes: 0 done, 2 wrong usage or configuration, 3 a fit has not converged, 4 data rejected; 1 is left for a fault of
the program itself. Only the modules of this folder and typer are imported before a command starts to work.
"""

import os
import sys
from collections.abc import Sequence
from typing import NoReturn

import typer

from . import (
    batch,
    budget,
    calibrate,
    compare,
    demo,
    doctor,
    energy,
    fit,
    inspect,
    map,
    models,
    results,
    simulate,
)
from .failure import INTERRUPTED, failure_of
from .options import example, grouped
from .output import tell, tell_json

app = typer.Typer(
    name="fricjax",
    help="Friction coefficients from a measured free decay.\n\nStart with: fricjax demo",
    epilog=example("fit run.csv --rig rig.toml"),
    no_args_is_help=True,
    add_completion=False,
    # Failures are worded in `run`.
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
for _name, _function, _example in (
    ("demo", demo.demo, ""),
    ("inspect", inspect.inspect, "run.csv --plot run.png"),
    ("check", inspect.check, '--rig rig.toml --x0 "2 mm" --free mu=0.01,damping'),
    ("fit", fit.fit, "run.csv --rig rig.toml"),
    ("compare", compare.compare, "run.csv --rig rig.toml --friction coulomb --friction stribeck"),
    ("batch", batch.batch, "runs --rig rig.toml --out results"),
    ("status", results.status, "results"),
    ("query", results.query, '"select file, mu from runs order by mu" results'),
    ("map", map.map_, "run1.csv run2.csv run3.csv --rig rig.toml"),
    ("energy", energy.energy, "run.csv --rig rig.toml"),
    ("budget", budget.budget, "fit.json --rig rig.toml"),
    ("simulate", simulate.simulate, '--rig rig.toml --x0 "2 mm" --fix mu=0.02 --out run.csv'),
    ("report", results.report, "fit.json --out report.html"),
    ("doctor", doctor.doctor, ""),
):
    app.command(_name, epilog=example(f"{_name} {_example}"))(grouped(_function))
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(models.app, name="models")


def _version(asked: bool) -> None:
    if asked:
        from .. import __version__

        typer.echo(f"fricjax {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Friction coefficients from a measured free decay. Start with: [bold]fricjax demo[/bold]."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line.

    Args:
        arguments: the words after ``fricjax``.

    Returns:
        The exit code.
    """
    try:
        # On its own the parser would word its errors itself, end the process, and know nothing of --json.
        code = app(list(arguments), prog_name="fricjax", standalone_mode=False)
        if code == INTERRUPTED:  # typer takes Ctrl-C and leaves only its exit code
            raise KeyboardInterrupt
        # What is still in the buffer meets a full disk here, where that is told, and not while Python shuts down.
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of our output has gone, as `head` does; that is no failure of ours, and nothing more can be said.
        # Python flushes stdout once more at its end, and must find something that takes the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        # The words themselves are looked at, for the parser may be what failed.
        if "--debug" in arguments and not isinstance(error, KeyboardInterrupt):
            import traceback

            tell(sys.stderr, traceback.format_exc().rstrip())
        failure = failure_of(error)
        if "--json" in arguments:
            tell_json(sys.stdout, failure.to_dict())
        elif failure.text:
            tell(sys.stderr, failure.text)
        return failure.exit_code
    return code if isinstance(code, int) else 0


def main() -> NoReturn:
    """Run the command line of this process and end it with the exit code."""
    sys.exit(run(sys.argv[1:]))
