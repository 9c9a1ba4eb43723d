"""``fricjax demo``: fit the example of the package."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from ..errors import UsageError
from .fit import OneFit, fitted, planned, report
from .options import Machine, Reading, Writing
from .output import deliver, prepare, working
from .records import read_record
from .targets import check_folder

if TYPE_CHECKING:
    from ..data import Record
    from ..fitting import Fit


def demo(
    output: Writing,
    out: Annotated[Path, Option(help="Folder to write into.")] = Path("fricjax-demo"),
) -> None:
    """Fit the example run that comes with fricjax.

    The command writes the run, its rig file, the fit and a picture.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out '{out}' is a file. Name a folder.")
    if out.is_dir() and any(out.iterdir()) and not output.force:
        raise UsageError(f"The folder '{out}' is not empty. Name another with --out, or add --force to write into it.")
    # The folder may not exist yet: check the nearest folder above it.
    check_folder(next(each for each in (out, *out.absolute().parents) if each.is_dir()), out)
    with working(output, "Fitting the example run"):
        from ..data.read import example_paths

        run, rig = example_paths()
        choice, settings = planned([run], OneFit(), Machine(rig=rig), Reading())
        record = read_record(run, Reading())
        prepare(output)
        fit = fitted(choice, settings, [record])
    data, text = report(fit, choice)
    data["truth"] = record.meta["coefficients"]
    mine = out / "run.csv"
    data["next"] = [
        f"fricjax inspect {mine} --plot {out / 'run.png'}",
        f"fricjax fit {mine}",
        f"fricjax fit {mine} --rig {out / 'rig.toml'} --plot {out / 'mine.png'} --out {out / 'mine.json'}",
        f"fricjax fit {mine} --rig {out / 'rig.toml'} --friction tanh --fix v_s=1e-5",
        f"fricjax report {out / 'fit.json'} --out {out / 'fit.html'}",
        "fricjax fit --help",
    ]
    advice = "Next:\n" + "\n".join(f"  {command}" for command in data["next"])
    text = f"{text}\n\n{_comparison(fit, record)}"
    deliver(output, data, text, lambda: _write(out, run, rig, fit, output.force), after=advice)


def _write(out: Path, run: Path, rig: Path, fit: "Fit", force: bool) -> dict[str, str]:
    """Write the four files of the demonstration."""
    from ..show import save
    from ..show.files import write_bytes

    out.mkdir(parents=True, exist_ok=True)
    files = {
        "run": write_bytes(out / "run.csv", run.read_bytes(), overwrite=force),
        "rig": write_bytes(out / "rig.toml", rig.read_bytes(), overwrite=force),
        "fit": fit.save(out / "fit.json", overwrite=force),
        "picture": save(fit.plot(), out / "fit.png", overwrite=force),
    }
    return {name: str(path) for name, path in files.items()}


def _comparison(fit: "Fit", record: "Record") -> str:
    """Return a table of true and fitted values."""
    from ..show import Table, plain, uncertain

    rows = []
    for name, true in record.meta["coefficients"].items():
        if name in fit.std_errors:
            value, std = fit.values[name], fit.std_errors[name]
            shown = uncertain(value, std, fit.units[name])
            rows.append([name, plain(true, 9), shown, f"{(value - true) / std:+.1f}"])
    title = "The run is synthetic, so its true values are known (statistical uncertainties):"
    return Table(["Parameter", "True", "Fitted", "Off by [standard errors]"], rows, title).text()
