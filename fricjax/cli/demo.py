"""``fricjax demo``: the main job on the example that comes with the package, and what to type next."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from .fit import Asked, Fitting, fitted, report
from .options import Machine, Output, Reading
from .output import finish, working
from .runtime import prepare

if TYPE_CHECKING:
    from ..data import Record
    from ..fitting import Fit


def demo(
    output: Output,
    out: Annotated[Path, Option(help="Folder to write into.")] = Path("fricjax-demo"),
    force: Annotated[bool, Option("--force", help="Write into a folder that is not empty.")] = False,
) -> None:
    """Fit the run that comes with fricjax: writes the run, its rig file, the fit and a picture."""
    _check_folder(out, force)
    with working(output, "Fitting the example run"):
        prepare(output)
        from ..data.examples import example_paths

        run, rig = example_paths()
        asked = Asked.of([run], Fitting(), Machine(rig=rig), Reading())
        records, found = fitted(asked)
    data, text = report(found, asked.choice)
    data["truth"] = records[0].meta["coefficients"]
    data["files"] = _write(out, run, rig, found)
    data["next"] = _next(out)
    finish(output, data, "\n\n".join([text, _comparison(found, records[0]), _advice(data["files"], data["next"])]))


def _check_folder(out: Path, force: bool) -> None:
    from ..data.errors import UsageError

    if out.exists() and not out.is_dir():
        raise UsageError(f"--out '{out}' is a file. Name a folder.")
    if out.is_dir() and any(out.iterdir()) and not force:
        raise UsageError(f"The folder '{out}' is not empty. Name another with --out, or add --force to write into it.")


def _write(out: Path, run: Path, rig: Path, found: "Fit") -> dict[str, str]:
    """The four files of the demonstration."""
    from ..show import save

    out.mkdir(parents=True, exist_ok=True)
    files = {name: out / name for name in ("run.csv", "rig.toml", "fit.json", "fit.png")}
    shutil.copyfile(run, files["run.csv"])
    shutil.copyfile(rig, files["rig.toml"])
    found.save(files["fit.json"])
    save(found.plot(), files["fit.png"])
    return {name.replace(".", "_"): str(path) for name, path in files.items()}


def _comparison(found: "Fit", record: "Record") -> str:
    """Fitted values beside the true ones, which a synthetic run knows."""
    from ..show import Table, plain, uncertain

    rows = []
    for name, true in record.meta["coefficients"].items():
        if name in found.std_errors:
            std = found.std_errors[name]
            shown = uncertain(found.values[name], std, found.units[name])
            rows.append([name, plain(true, 9), shown, f"{(found.values[name] - true) / std:+.1f}"])
    title = "The run is synthetic, so its true values are known (statistical uncertainties):"
    return Table(["Parameter", "True", "Fitted", "Off by [standard errors]"], rows, title).text()


def _next(out: Path) -> list[str]:
    run, rig = out / "run.csv", out / "rig.toml"
    return [
        f"fricjax inspect {run} --plot {out / 'run.png'}",
        f"fricjax fit {run}",
        f"fricjax fit {run} --rig {rig} --plot {out / 'mine.png'} --out {out / 'mine.json'}",
        f"fricjax fit {run} --rig {rig} --friction tanh --fix v_s=1e-5",
        "fricjax fit --help",
    ]


def _advice(files: dict[str, Any], commands: list[str]) -> str:
    written = "\n".join(f"  {path}" for path in files.values())
    return f"Written:\n{written}\n\nNext:\n" + "\n".join(f"  {command}" for command in commands)
