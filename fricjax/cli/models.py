"""``fricjax models``: the catalogue of friction laws, generated from their classes."""

import dataclasses
import math
import re
from typing import Annotated, Any

import typer
from typer import Argument

from ..friction.catalogue import CATALOGUE
from ..machine.laws import find_law, laws
from .options import Output, example, grouped
from .output import finish, prepare

_MARKUP = re.compile(r":\w+:`([^`]+)`")
_KINDS = {
    "bristle": "law with internal states that hold the mass",
    "set-valued": "set-valued law that holds the mass at rest",
    "smooth": "smooth law that holds nothing at rest",
}


def models(context: typer.Context, output: Output) -> None:
    """List the friction laws with their coefficients and units.

    The command fricjax models show NAME describes one law.
    """
    if context.invoked_subcommand is not None:
        return
    prepare(output)
    from .. import friction

    entries = [describe(name, getattr(friction, law.name)) for name, law in CATALOGUE.items()]
    lines = ["Friction laws for --friction; join them with +, as coulomb+quadraticdrag.", ""]
    for entry in entries:
        units = [f"{c['name']} [{c['unit'] or '1'}]" for c in entry["coefficients"]]
        only = "" if entry["on_command_line"] else "; from Python only, because its coefficients are lists"
        lines += [f"{entry['name']}: {entry['kind']}{only}", f"    {', '.join(units)}", f"    {entry['about']}", ""]
    lines.append("Coefficients of the machine: mass, stiffness, damping, normal_force, drag, and k3 of a cubic spring.")
    lines.append("Details of one law: fricjax models show NAME")
    finish(output, {"schema": "fricjax.models/1", "models": entries}, "\n".join(lines))


def show(
    name: Annotated[str, Argument(help="Name of a law, from the list of fricjax models.", show_default=False)],
    output: Output,
) -> None:
    """Describe one law.

    The page shows equation, coefficients, bounds, source and engine, and which coefficients a free decay determines.
    """
    chosen = find_law(name, CATALOGUE)
    prepare(output)
    from .. import friction

    entry = describe(chosen.name.lower(), getattr(friction, chosen.name))
    finish(output, {"schema": "fricjax.law/1", **entry}, _page(entry))


app = typer.Typer(rich_markup_mode="rich")
app.callback(invoke_without_command=True)(grouped(models))
app.command("show", epilog=example("models show lugre"))(grouped(show))


def describe(name: str, law: Any) -> dict[str, Any]:
    """Return a law as data, from the docstring of its class."""
    from ..friction.kinds import AbstractConstant

    kind = CATALOGUE[name].kind
    engine = {"bristle": "smooth", "set-valued": "exact" if issubclass(law, AbstractConstant) else "hybrid"}
    paragraphs = (law.__doc__ or "").split("Attributes:")[0].strip().split("\n\n")
    about, *details = (" ".join(_MARKUP.sub(r"\1", part).replace("`", "").split()) for part in paragraphs)
    defaults = {field.name: field.default for field in dataclasses.fields(law)}
    coefficients = []
    for key, known in law.coefficients.items():
        default = defaults.get(key, dataclasses.MISSING)
        coefficients.append(
            {
                "name": key,
                "unit": known.unit,
                "about": known.about,
                "bounds": [end if math.isfinite(end) else None for end in (known.lower, known.upper)],
                "default": None if default is dataclasses.MISSING else default,
                "required": default is dataclasses.MISSING,
                "fitted_as": known.fitted_as,
            }
        )
    return {
        "name": name,
        "kind": _KINDS[kind],
        "on_command_line": name in laws(),
        "engine": engine.get(kind, "hybrid"),
        "about": about,
        "details": details,
        "coefficients": coefficients,
        "identifies": law.identifies,
        "source": law.source,
    }


def _page(entry: dict[str, Any]) -> str:
    from ..show import Table

    rows = []
    for c in entry["coefficients"]:
        low, high = ("" if end is None else f"{end:g}" for end in c["bounds"])
        bounds = f"{low} .. {high}".strip() if low or high else "any"
        default = "to be given" if c["required"] else "none" if c["default"] is None else f"{c['default']:g}"
        rows.append([c["name"], c["unit"] or "1", bounds, default, c["fitted_as"], c["about"]])
    table = Table(["Coefficient", "Unit", "Bounds", "Default", "Fitted as", "Meaning"], rows)
    return "\n".join(
        [
            f"{entry['name']}: {entry['kind']}; {entry['engine']} engine",
            "",
            entry["about"],
            *(f"\n{text}" for text in entry["details"]),
            "",
            table.text(),
            "",
            f"From a free decay: {entry['identifies']}",
            f"Source: {entry['source']}",
        ]
    )
