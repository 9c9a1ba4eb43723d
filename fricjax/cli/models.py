"""``fricjax models``: the catalogue of friction laws, made from the laws themselves."""

import dataclasses
import math
import re
from typing import Annotated, Any

import typer
from typer import Argument

from .groups import example, grouped
from .options import Output
from .output import finish
from .runtime import prepare

_MARKUP = re.compile(r":\w+:`([^`]+)`")


def models(context: typer.Context, output: Output) -> None:
    """List the friction laws with their coefficients and units; `models show NAME` tells all of one."""
    if context.invoked_subcommand is not None:
        return
    from ..friction.catalogue import CATALOGUE

    prepare(output)
    from .. import friction

    found = [describe(name, getattr(friction, law.name)) for name, law in CATALOGUE.items()]
    lines = ["Friction laws for --friction; join them with +, as coulomb+quadraticdrag.", ""]
    for entry in found:
        units = [f"{c['name']} [{c['unit'] or '1'}]" for c in entry["coefficients"]]
        only = "" if entry["on_command_line"] else "; from Python only, for its coefficients are lists"
        lines += [f"{entry['name']}: {entry['kind']}{only}", f"    {', '.join(units)}", f"    {entry['about']}", ""]
    lines.append("Of the machine: mass, stiffness, damping, normal_force, drag, and k3 of a cubic spring.")
    lines.append("All of one law: fricjax models show NAME")
    finish(output, {"models": found}, "\n".join(lines))


def show(
    name: Annotated[str, Argument(help="Name of a law, as in the list of fricjax models.", show_default=False)],
    output: Output,
) -> None:
    """All of one law: equation, coefficients with bounds, source, engine, and what a decay tells of it."""
    from ..friction.catalogue import CATALOGUE
    from .laws import find_law

    chosen = find_law(name, CATALOGUE)
    prepare(output)
    from .. import friction

    entry = describe(chosen.name.lower(), getattr(friction, chosen.name))
    finish(output, entry, _page(entry))


app = typer.Typer(rich_markup_mode="rich")
app.callback(invoke_without_command=True)(grouped(models))
app.command("show", epilog=example("models show lugre"))(grouped(show))


def describe(name: str, law: Any) -> dict[str, Any]:
    """A law as data."""
    from .laws import laws

    paragraphs = (law.__doc__ or "").split("Attributes:")[0].strip().split("\n\n")
    about, *details = (" ".join(_MARKUP.sub(r"\1", part).replace("`", "").split()) for part in paragraphs)
    return {
        "name": name,
        "kind": _kind(law),
        "on_command_line": name in laws(),
        "engine": _engine(law),
        "about": about,
        "details": details,
        "coefficients": [_coefficient(law, key, known) for key, known in law.coefficients.items()],
        "identifies": law.identifies,
        "source": law.source,
    }


def _coefficient(law: Any, name: str, known: Any) -> dict[str, Any]:
    fields = {field.name: field for field in dataclasses.fields(law)}
    default = fields[name].default if name in fields else dataclasses.MISSING
    bounds = [end if math.isfinite(end) else None for end in (known.lower, known.upper)]
    return {
        "name": name,
        "unit": known.unit,
        "about": known.about,
        "bounds": bounds,
        "default": None if default is dataclasses.MISSING else default,
        "required": default is dataclasses.MISSING,
        "fitted_as": known.fitted_as,
    }


def _page(entry: dict[str, Any]) -> str:
    from ..show import Table

    rows = [
        [c["name"], c["unit"] or "1", _range(c["bounds"]), _default(c), c["fitted_as"], c["about"]]
        for c in entry["coefficients"]
    ]
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


def _range(bounds: list[float | None]) -> str:
    low, high = ("" if end is None else f"{end:g}" for end in bounds)
    return f"{low} .. {high}".strip() if low or high else "any"


def _default(coefficient: dict[str, Any]) -> str:
    if coefficient["required"]:
        return "to be given"
    return "none" if coefficient["default"] is None else f"{coefficient['default']:g}"


def _kind(law: Any) -> str:
    if law.n_states:
        return "law with internal states that hold the mass"
    return "set-valued law that holds the mass at rest" if law.set_valued else "smooth law that holds nothing at rest"


def _engine(law: Any) -> str:
    from ..friction.kinds import AbstractConstant

    if law.n_states:
        return "smooth"
    return "exact" if law.set_valued and issubclass(law, AbstractConstant) else "hybrid"
