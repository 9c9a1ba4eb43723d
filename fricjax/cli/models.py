"""``fricjax models``: the catalogue of friction laws, made from the laws themselves."""

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
    """List the friction laws with their coefficients and units; `models show NAME` shows all of one."""
    if context.invoked_subcommand is not None:
        return
    prepare(output)
    from .. import friction

    entries = [describe(name, getattr(friction, law.name)) for name, law in CATALOGUE.items()]
    lines = ["Friction laws for --friction; join them with +, as coulomb+quadraticdrag.", ""]
    for entry in entries:
        units = [f"{c['name']} [{c['unit'] or '1'}]" for c in entry["coefficients"]]
        only = "" if entry["on_command_line"] else "; from Python only, for its coefficients are lists"
        lines += [f"{entry['name']}: {entry['kind']}{only}", f"    {', '.join(units)}", f"    {entry['about']}", ""]
    lines.append("Of the machine: mass, stiffness, damping, normal_force, drag, and k3 of a cubic spring.")
    lines.append("All of one law: fricjax models show NAME")
    finish(output, {"models": entries}, "\n".join(lines))


def show(
    name: Annotated[str, Argument(help="Name of a law, as in the list of fricjax models.", show_default=False)],
    output: Output,
) -> None:
    """All of one law: equation, coefficients with bounds, source, engine, and what a decay determines of it."""
    chosen = find_law(name, CATALOGUE)
    prepare(output)
    from .. import friction

    entry = describe(chosen.name.lower(), getattr(friction, chosen.name))
    finish(output, entry, _page(entry))


app = typer.Typer(rich_markup_mode="rich")
app.callback(invoke_without_command=True)(grouped(models))
app.command("show", epilog=example("models show lugre"))(grouped(show))


def describe(name: str, law: Any) -> dict[str, Any]:
    """A law as data, from its class: what its docstring says, and what it declares of its coefficients."""
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
            f"A free decay tells: {entry['identifies']}",
            f"Source: {entry['source']}",
        ]
    )
