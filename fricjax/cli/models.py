"""``fricjax models``: the friction laws with their coefficients and units."""

from typing import Any

from .options import Output
from .output import finish
from .runtime import prepare


def models(output: Output) -> None:
    """List the friction laws with their coefficients, units and engines."""
    prepare(output)
    from .machine import laws

    found = [describe(name, law) for name, law in laws().items()]
    lines = ["Friction laws for --friction; join them with +, as coulomb+windage.", ""]
    for entry in found:
        units = [f"{name} [{unit or '1'}]" for name, unit in entry["coefficients"].items()]
        lines += [f"{entry['name']:<10}{entry['kind']}", f"{'':<10}{', '.join(units)}", f"{'':<10}{entry['about']}", ""]
    lines.append("Of the machine: mass, stiffness, damping, normal_force, drag, and k3 of a cubic spring.")
    finish(output, {"models": found}, "\n".join(lines))


def describe(name: str, law: Any) -> dict[str, Any]:
    """A law as data: its name, kind, coefficients with units, and the first line of its description."""
    text = " ".join((law.__doc__ or "").split("\n\n")[0].replace("``", "").split())
    return {
        "name": name,
        "kind": _kind(law),
        "coefficients": {name: known.unit for name, known in law.coefficients.items()},
        "about": text,
    }


def _kind(law: Any) -> str:
    if law.n_states:
        return "bristle law with internal states, smooth engine"
    from ..friction.base import AbstractConstant

    if law.set_valued:
        engine = "exact" if issubclass(law, AbstractConstant) else "hybrid"
        return f"set-valued law: holds the mass at rest, {engine} engine"
    return "smooth law: holds nothing at rest"
