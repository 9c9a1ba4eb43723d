"""Entry point of ``fricjax``: list of commands and handler of failures.

`fricjax.cli.failure.CODES` lists the exit codes. Only typer and the modules of this folder are imported before a
command starts its work.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from ..errors import UsageError, nearest
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

SCHEMAS = Path(__file__).with_name("schemas")
"""Folder of the JSON schemas of all outputs."""
app = typer.Typer(
    name="fricjax",
    help="Friction coefficients from a measured free decay.\n\nStart with: fricjax demo",
    epilog=example("fit run.csv --rig rig.toml"),
    no_args_is_help=True,
    add_completion=False,
    # `run` turns failures into sentences.
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


def _version(shown: bool) -> None:
    if shown:
        from .. import __version__

        typer.echo(f"fricjax {__version__}")
        raise typer.Exit


def _schema(name: str | None) -> None:
    if name is not None:
        paths = {path.stem: path for path in sorted(SCHEMAS.glob("*.json"))}
        if name not in paths:
            raise UsageError(f"There is no schema '{name}'.{nearest(name, paths)} Choose one of {', '.join(paths)}.")
        typer.echo(paths[name].read_text(encoding="utf-8"), nl=False)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    schema: Annotated[
        str | None,
        typer.Option(
            callback=_schema,
            is_eager=True,
            metavar="NAME",
            help="Show the JSON schema of an output, such as fit, and exit.",
        ),
    ] = None,
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
        # In standalone mode the parser would print its errors without regard to --json, and end the process.
        code = app(list(arguments), prog_name="fricjax", standalone_mode=False)
        if code == INTERRUPTED:  # typer catches Ctrl-C and returns its exit code
            raise KeyboardInterrupt
        # A full disk must fail here, with a message, and not while Python shuts down.
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output has closed it, as `head` does. This is not a failure.
        # Python flushes stdout once more when it exits: give it a stream that accepts the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        # The options are not available if the parser failed, so search the raw words.
        if "--debug" in arguments and not isinstance(error, KeyboardInterrupt):
            import traceback

            tell(sys.stderr, traceback.format_exc().rstrip())
        failure = failure_of(error)
        if "--json" in arguments:
            tell_json(sys.stdout, {"schema": "fricjax.error/1", **failure.to_dict()})
        elif failure.text:
            tell(sys.stderr, failure.text)
        return failure.exit_code
    return code if isinstance(code, int) else 0


def main() -> NoReturn:
    """Run the command line of this process and exit with its code."""
    sys.exit(run(sys.argv[1:]))
