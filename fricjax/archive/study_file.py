"""Study defined by a file, `study.toml`.

    friction = ["coulomb", "coulomb+quadraticdrag"]
    free = ["mu", "damping", "stiffness"]
    rig = "rig.toml"
    facts = ["load_{load}N/run_{number}.csv"]
    exclude = ["calibration/**"]

    [reading]
    unit = "um"

    [[runs]]
    pattern = "lab_b/**"
    rig = "lab_b.toml"
    reading = { column = "x", time = "t" }

Paths are relative to the file. Keys are the options of ``fricjax batch``, validated by the same code.
"""

import functools
import re
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from ..data.files import read_toml
from ..errors import UsageError, brief, nearest
from ..machine import parsing
from .study import Law, Rule, Study

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError


def read_study(path: str | Path) -> Study:
    r"""Read the study that a file defines.

    Raises:
        UsageError: missing file, invalid TOML, an unknown key, or an invalid value; the message names file, key and
            value.

    Examples:
        >>> from pathlib import Path
        >>> import fricjax as fj
        >>> _ = Path("rig.toml").write_text(fj.data.example_paths().rig.read_text())
        >>> _ = Path("study.toml").write_text('rig = "rig.toml"\nfrictoin = "coulomb"')
        >>> read_study("study.toml")
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: study.toml: there is no key 'frictoin' in a study file. Did you mean 'friction'? ...
    """
    file = Path(path)
    asked = _checked(file, read_toml(file, "study"))
    try:
        return _study(file.parent, asked)
    except UsageError as error:
        words = str(error)
        if not words.startswith(str(file)):
            # Replace the names of command-line options by keys of the file.
            words = f"{file}: {re.sub(r'--([a-z]+)', lambda match: match[1], words)}"
        raise UsageError(words) from error


@functools.cache
def _fields() -> "tuple[type[BaseModel], type[BaseModel]]":
    """Return the models of a study file and of its tables [[runs]].

    pydantic is imported on demand.
    """
    from pydantic import BaseModel, ConfigDict

    class Runs(BaseModel):
        model_config = ConfigDict(extra="forbid", strict=True)
        pattern: str
        rig: str | None = None
        reading: dict[str, Any] = {}

    class StudyFile(BaseModel):
        model_config = ConfigDict(extra="forbid", strict=True)
        root: str = "."
        friction: str | list[str] = "coulomb"
        free: str | list[str] | None = None
        include: str | list[str] = []
        exclude: str | list[str] = []
        facts: str | list[str] = []
        rig: str | None = None
        restoring: str | None = None
        mass: str | float | None = None
        stiffness: str | float | None = None
        normal_force: str | float | None = None
        drag: float | None = None
        fix: dict[str, float] = {}
        engine: str = "auto"
        start: str | float = "first_reversal"
        nuisance: str | list[str] | None = None
        loss: str = "squares"
        noise: str = "auto"
        guess: dict[str, float] = {}
        bounds: dict[str, str] = {}
        priors: dict[str, str] = {}
        tie: dict[str, str] = {}
        residuals: bool = False
        reading: dict[str, Any] = {}
        runs: list[Runs] = []

    return StudyFile, Runs


def _checked(file: Path, table: Mapping[str, Any]) -> Any:
    """Validate the types of the fields of a study file."""
    from pydantic import BaseModel, ValidationError

    fields, runs = _fields()
    try:
        checked: BaseModel = fields.model_validate(table)
    except ValidationError as error:
        raise UsageError(f"{file}: {_sentence(error, list(fields.model_fields), list(runs.model_fields))}") from error
    return checked


_KINDS = {
    "string_type": "a text in quotes",
    "float_type": "a number",
    "int_type": "a number",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
}


def _sentence(error: "ValidationError", fields: list[str], of_runs: list[str]) -> str:
    """Describe the first validation error in one sentence."""
    errors = error.errors()
    first = errors[0]
    # The location also contains the branches of a union.
    branch = re.compile(r".*[\[\]].*|str|float|int")
    place = [part for part in first["loc"] if not (isinstance(part, str) and branch.fullmatch(part))]
    names = [str(part) if isinstance(part, str) else f"[{int(part) + 1}]" for part in place]
    field = ".".join(names).replace(".[", "[")
    known = of_runs if names[0] == "runs" and len(names) > 1 else fields
    if first["type"] == "extra_forbidden":
        return f"there is no key '{field}' in a study file.{nearest(names[-1], known)} Known are {', '.join(known)}."
    if first["type"] == "missing":
        return f"'{field}' is missing; add a line such as {names[-1]} = \"lab_b/**\"."
    same = [each for each in errors if each["loc"][: len(place)] == first["loc"][: len(place)]]
    kinds = list(dict.fromkeys(_KINDS.get(each["type"], each["msg"]) for each in same))
    return f"'{field}' must be {' or '.join(kinds)}, got {brief(first['input'])}."


def _study(folder: Path, asked: Any) -> Study:
    """Build the study from validated fields."""
    from ..fitting.settings import check_settings
    from ..machine.choose import choose
    from ..rig import Rig

    settings = _settings(asked)
    choices = {}
    for friction in _texts(asked.friction):
        words: Any = SimpleNamespace(friction=friction, **_machine(folder, asked))
        free = None if asked.free is None else ",".join(_texts(asked.free))
        choice = choose(words, free, tuple(settings["tie"]))
        check_settings(choice.model, choice.free, 1, {**settings, "sigma_mode": "absolute"})
        choices["+".join(law.name.lower() for law in choice.laws)] = choice
    first = next(iter(choices.values()))
    base = None if _only_rules(asked) else first.rig
    rules = []
    for runs in asked.runs:
        rig = base if runs.rig is None else Rig.from_toml(folder / runs.rig)
        rules.append(Rule(runs.pattern, {**asked.reading, **runs.reading}, rig, runs.rig or asked.rig or ""))
    rules.append(Rule("**", asked.reading, base, asked.rig or ""))
    return Study(
        folder / asked.root,
        tuple(Law(name, choice.oscillator, choice.free) for name, choice in choices.items()),
        include=tuple(_texts(asked.include)),
        exclude=tuple(_texts(asked.exclude)),
        rules=tuple(rules),
        facts=tuple(_texts(asked.facts)),
        settings={**settings, "engine": first.engine},
        calibrated=base is not None,
        residuals=asked.residuals,
    )


def _machine(folder: Path, asked: Any) -> dict[str, Any]:
    """Return the arguments for :mod:`fricjax.machine.choose`, without the law."""
    # If only rules have rigs, validate the study with the first of them.
    rig = next(runs.rig for runs in asked.runs if runs.rig) if _only_rules(asked) else asked.rig
    texts = {name: getattr(asked, name) for name in ("mass", "stiffness", "normal_force")}
    return {
        "rig": None if rig is None else folder / rig,
        "fix": [f"{name}={value!r}" for name, value in asked.fix.items()] or None,
        "restoring": asked.restoring,
        **{name: None if value is None else str(value) for name, value in texts.items()},
        "drag": asked.drag,
        "engine": asked.engine,
    }


def _only_rules(asked: Any) -> bool:
    """Return True if rules have rigs and the study has no rig."""
    return asked.rig is None and asked.normal_force is None and any(runs.rig for runs in asked.runs)


def _settings(asked: Any) -> dict[str, Any]:
    """Return the keywords of `fricjax.fit_batch`."""
    return {
        "nuisance": None if asked.nuisance is None else _texts(asked.nuisance),
        "start": asked.start if isinstance(asked.start, str) else float(asked.start),
        "bounds": {name: parsing.span(f"bounds.{name}", text) for name, text in asked.bounds.items()},
        "priors": {name: parsing.estimate(f"priors.{name}", text) for name, text in asked.priors.items()},
        "tie": {name: parsing.tied(text) for name, text in asked.tie.items()},
        "guess": {name: float(value) for name, value in asked.guess.items()},
        "loss": asked.loss,
        "noise": asked.noise,
    }


def _texts(value: str | list[str]) -> list[str]:
    return [value] if isinstance(value, str) else value
