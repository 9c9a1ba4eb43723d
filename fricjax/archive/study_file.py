"""Study defined by a file, `study.toml`.

    friction = ["coulomb", "coulomb+quadraticdrag"]
    rig = "rig.toml"
    facts = "load_{load}N/run_{number}.csv"
    reading = { unit = "um" }

    [[runs]]
    pattern = "lab_b/**"
    rig = "lab_b.toml"
    reading = { column = "x", time = "t" }

Paths are relative to the file. Keys are the options of ``fricjax batch``, validated by the same code.
"""

import re
import types
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args, get_origin

from ..data.files import read_toml
from ..errors import UsageError, brief, nearest
from ..machine import parsing
from .study import Law, Rule, Study


@dataclass(frozen=True)
class _Runs:
    """Keys of a table [[runs]]."""

    pattern: str
    rig: str | None = None
    reading: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _StudyFile:
    """Keys of a study file."""

    root: str = "."
    friction: list[str] = field(default_factory=lambda: ["coulomb"])
    free: list[str] | None = None
    include: list[str] = field(default_factory=list)
    exclude: list[str] = field(default_factory=list)
    facts: list[str] = field(default_factory=list)
    rig: str | None = None
    restoring: str | None = None
    mass: str | float | None = None
    stiffness: str | float | None = None
    normal_force: str | float | None = None
    drag: float | None = None
    fix: dict[str, float] = field(default_factory=dict)
    engine: str = "auto"
    start: str | float = "first_reversal"
    nuisance: list[str] | None = None
    loss: str = "squares"
    noise: str = "auto"
    guess: dict[str, float] = field(default_factory=dict)
    bounds: dict[str, str] = field(default_factory=dict)
    priors: dict[str, str] = field(default_factory=dict)
    tie: dict[str, str] = field(default_factory=dict)
    residuals: bool = False
    reading: dict[str, Any] = field(default_factory=dict)
    runs: list[_Runs] = field(default_factory=list)


def read_study(path: str | Path) -> Study:
    """Read the study that a file defines.

    Raises:
        UsageError: a missing or invalid file; the message names file, key and value.
    """
    file = Path(path)
    table = read_toml(file, "study")
    try:
        return _study(file.parent, _table("", table, _StudyFile))
    except UsageError as error:
        words = str(error)
        if not words.startswith(str(file)):
            # Replace the names of command-line options by keys of the file.
            words = f"{file}: {re.sub(r'--([a-z]+)', lambda match: match[1], words)}"
        raise UsageError(words) from error


_KINDS = {
    str: "a text in quotes",
    float: "a number",
    bool: "true or false",
    list[str]: "a text in quotes or a list",
    list[_Runs]: "a list",
}


def _checked(place: str, value: Any, kind: Any) -> Any:
    """Return a value in the type of its key."""
    kinds = get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
    for each in kinds:
        origin, inner = get_origin(each) or each, get_args(each)
        if origin is Any or type(value) is each:
            return value
        if origin is float and type(value) is int:
            return float(value)
        if each == list[str] and isinstance(value, str):
            return [value]
        if isinstance(value, list) and origin is list:
            return [_checked(f"{place}[{i}]", item, inner[0]) for i, item in enumerate(value, 1)]
        if isinstance(value, dict) and origin is dict:
            return {name: _checked(f"{place}.{name}", item, inner[1]) for name, item in value.items()}
        if isinstance(value, dict) and is_dataclass(each):
            return _table(f"{place}.", value, each)
    words = [_KINDS.get(each, "a table") for each in kinds if each is not types.NoneType]
    raise UsageError(f"'{place}' must be {' or '.join(words)}, got {brief(value)}.")


def _table(place: str, table: dict[str, Any], kind: Any) -> Any:
    """Return a table as the dataclass of its keys."""
    kinds = {each.name: each.type for each in fields(kind)}
    for key in table:
        if key not in kinds:
            known = f"{nearest(key, kinds)} Known are {', '.join(kinds)}."
            raise UsageError(f"there is no key '{place}{key}' in a study file.{known}")
    if kind is _Runs and "pattern" not in table:
        raise UsageError(f"'{place}pattern' is missing; add a line such as pattern = \"lab_b/**\".")
    return kind(**{key: _checked(f"{place}{key}", value, kinds[key]) for key, value in table.items()})


def _study(folder: Path, asked: _StudyFile) -> Study:
    """Build the study from validated fields."""
    from ..fitting.settings import check_settings
    from ..machine.choose import choose
    from ..rig import Rig

    settings = {
        "bounds": {name: parsing.span(f"bounds.{name}", text) for name, text in asked.bounds.items()},
        "priors": {name: parsing.estimate(f"priors.{name}", text) for name, text in asked.priors.items()},
        "tie": {name: parsing.tied(text) for name, text in asked.tie.items()},
        **{name: getattr(asked, name) for name in ("nuisance", "start", "guess", "loss", "noise")},
    }
    # If rules have rigs and the study has no machine, validate the study with the first of these rigs.
    rigs = [runs.rig for runs in asked.runs if runs.rig]
    only_rules = asked.rig is None and asked.normal_force is None and bool(rigs)
    rig = rigs[0] if only_rules else asked.rig
    texts = {name: getattr(asked, name) for name in ("mass", "stiffness", "normal_force")}
    machine: dict[str, Any] = {
        **vars(asked),
        **{name: None if value is None else str(value) for name, value in texts.items()},
        "rig": None if rig is None else folder / rig,
        "fix": [f"{name}={value!r}" for name, value in asked.fix.items()] or None,
    }
    free = None if asked.free is None else ",".join(asked.free)
    choices = {}
    for friction in asked.friction:
        options: Any = SimpleNamespace(**{**machine, "friction": friction})
        choice = choose(options, free, tuple(settings["tie"]))
        check_settings(choice.model, choice.free, 1, {**settings, "sigma_mode": "absolute"})
        choices["+".join(law.name.lower() for law in choice.laws)] = choice
    first = next(iter(choices.values()))
    base = None if only_rules else first.rig
    rules = []
    for runs in asked.runs:
        rig = base if runs.rig is None else Rig.from_toml(folder / runs.rig)
        rules.append(Rule(runs.pattern, {**asked.reading, **runs.reading}, rig, runs.rig or asked.rig or ""))
    rules.append(Rule("**", asked.reading, base, asked.rig or ""))
    return Study(
        folder / asked.root,
        tuple(Law(name, choice.oscillator, choice.free) for name, choice in choices.items()),
        include=tuple(asked.include),
        exclude=tuple(asked.exclude),
        rules=tuple(rules),
        facts=tuple(asked.facts),
        settings={**settings, "engine": first.engine},
        calibrated=base is not None,
        residuals=asked.residuals,
    )
