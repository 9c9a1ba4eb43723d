"""What of an archive is fitted, and how: which files, how each is read, on which rig it was made, and which laws.

A study is plain data beside its rigs and laws, so that workers elsewhere get it as it is. What matters for the result
of a run goes into a digest, by which records of other settings are distinguished.
"""

import dataclasses
import functools
import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import DataError, UsageError

if TYPE_CHECKING:
    from ..fitting.parameters import Request
    from ..oscillator import Oscillator
    from ..rig import Rig

SCHEMA = "fricjax.archive/1"
"""Version of the table's columns and of what is kept of a run; another one asks for new fits."""

# A fact in a template, as {load} in "load_{load}N/run_{number}.csv".
_FACT = re.compile(r"\{([a-z_][a-z_0-9]*)\}")
# Names of facts that the table has already.
_LOAD = "load"


@dataclasses.dataclass(frozen=True)
class Law:
    """A friction law that is fitted to every run.

    Attributes:
        name: as on the command line, "coulomb" or "coulomb+quadraticdrag".
        oscillator: the machine with that law; a rig of a rule replaces the machine.
        free: names of the free coefficients.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> fj.archive.Law("coulomb", machine, ("mu", "damping", "stiffness")).free
        ('mu', 'damping', 'stiffness')
    """

    name: str
    oscillator: "Oscillator"
    free: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Rule:
    """How the runs of a pattern are read, and on which rig they were made.

    Attributes:
        pattern: files it is for, relative to the folder of the study, as "lab_b/**/*.csv".
        reading: options of `fricjax.read`, and `crop` with the ends of the span that is kept [s].
        rig: the rig; None: that of the study, or none.
        rig_name: the name of its file.

    Examples:
        >>> import fricjax as fj
        >>> rule = fj.archive.Rule("lab_b/**/*.csv", {"unit": "um"})
        >>> rule.takes("lab_b/may/run.csv"), rule.takes("lab_a/run.csv")
        (True, False)
    """

    pattern: str = "**"
    reading: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    rig: "Rig | None" = None
    rig_name: str = ""

    def takes(self, file: str) -> bool:
        """Whether a file is one of those that the rule is for."""
        return matches(file, self.pattern)


def matches(file: str, pattern: str) -> bool:
    """Whether a path of slashes matches a pattern, in which ``**`` stands for any folders and ``*`` for any name."""
    return _pattern(pattern).fullmatch(file) is not None


# What the signs of a pattern stand for, folders before names.
_SIGNS = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}


@functools.cache
def _pattern(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(\*\*/|\*\*|\*|\?)", pattern)
    return re.compile("".join(_SIGNS.get(part, re.escape(part)) for part in parts), re.DOTALL)


@dataclasses.dataclass(frozen=True)
class Study:
    """What is fitted, and how.

    Attributes:
        root: the folder that the paths of the runs are relative to.
        laws: the friction laws, each of which is fitted to every run.
        files: the runs, relative to `root`; None: all that `include` finds there.
        include, exclude: patterns of the files in the folder; without the former all that a reader is known for.
        rules: how files are read, the first one that takes a file counts; one that takes no file is as none.
        facts: templates of paths, as "load_{load}N/run_{number}.csv": what they name becomes a column, and a load the
            normal force [N].
        settings: keywords of `fricjax.fit_batch` beside those of the machine: `start`, `bounds`, `priors`, ...
        calibrated: whether mass and load of the laws are those of a real machine; otherwise only runs of rules with a
            rig have a coefficient of friction.
        residuals: whether the residuals of every run are written as netCDF.

    Examples:
        >>> import fricjax as fj
        >>> from pathlib import Path
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> law = fj.archive.Law("coulomb", machine, ("mu", "damping", "stiffness"))
        >>> study = fj.archive.Study(Path("runs"), (law,), facts=("load_{load}N/run_{number}.csv",))
        >>> study.facts_of("steel/load_9.66N/run_07.csv")
        {'load': '9.66', 'number': '07'}
        >>> study.load_of(study.facts_of("load_9.66N/run_07.csv"), study.rule_of("load_9.66N/run_07.csv"))
        9.66
    """

    root: Path
    laws: tuple[Law, ...]
    files: tuple[str, ...] | None = None
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    rules: tuple[Rule, ...] = ()
    facts: tuple[str, ...] = ()
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    calibrated: bool = True
    residuals: bool = False

    def rule_of(self, file: str) -> Rule:
        """The rule of a file."""
        return next((rule for rule in self.rules if rule.takes(file)), _ANY)

    def facts_of(self, file: str) -> dict[str, str]:
        """What the path of a file says by the first template that it ends like; empty where it is like none."""
        return facts_in(self.facts)(file)

    @property
    def fact_names(self) -> tuple[str, ...]:
        """Names of the facts, in the order of the templates, but the load, which is a column already."""
        names = dict.fromkeys(name for template in self.facts for name in _FACT.findall(template))
        return tuple(name for name in names if name != _LOAD)

    def load_of(self, facts: Mapping[str, str], rule: Rule) -> float:
        """The normal force of a run [N], from its path, its rig or the study's; NaN where none is known.

        Raises:
            DataError: what its path names as load is no positive number.
        """
        if _LOAD in facts:
            try:
                load = float(facts[_LOAD].replace(",", "."))
            except ValueError:
                load = math.nan
            if not 0 < load < math.inf:
                raise DataError(
                    f"Its path names the load {facts[_LOAD]!r}, which is no positive number of newtons. Rename it, or "
                    "change the template in facts=."
                )
            return load
        if rule.rig is not None:
            return rule.rig.normal_force.value
        return float(self.laws[0].oscillator.normal_force) if self.calibrated else math.nan

    def calibrated_by(self, rule: Rule) -> bool:
        """Whether coefficients of friction mean something for the runs of a rule."""
        return self.calibrated or rule.rig is not None

    def request(self, law: Law, rule: Rule, load: float) -> "Request":
        """What is asked of the runs of a rule under a load."""
        from ..fitting.parameters import Request

        rig = rule.rig
        machine = law.oscillator if rig is None else rig.oscillator(law.oscillator.friction)
        if math.isfinite(load) and load != float(machine.normal_force):
            machine = dataclasses.replace(machine, normal_force=load)
            rig = None if rig is None else rig.with_inputs({"normal_force": load})
        return Request.of(machine, law.free, rig=rig, **{**DEFAULTS, **self.settings})

    def digest(self, law: Law, rule: Rule, load: float) -> str:
        """A name of all settings that matter for the result of a run but the run itself."""
        from ..fitting.store import plain_fields

        rig = None if rule.rig is None else {n: (m.value, m.std) for n, m in rule.rig.numbers().items()}
        restoring = None if rule.rig is None else type(rule.rig.restoring).__name__
        known = [law.name, law.oscillator, list(law.free), dict(rule.reading), rig, restoring, load, self.calibrated]
        settings = {**DEFAULTS, **self.settings}
        text = json.dumps([SCHEMA, *plain_fields(known), plain_fields(settings)], sort_keys=True, default=repr)
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def described(self) -> dict[str, Any]:
        """The study as JSON can hold it, in the store for readers, and for what comes later to be held against."""
        from ..fitting.store import plain_fields

        rules = [
            {
                "pattern": rule.pattern,
                "reading": dict(rule.reading),
                "rig": rule.rig_name,
                "inputs": {} if rule.rig is None else {n: [m.value, m.std] for n, m in rule.rig.numbers().items()},
            }
            for rule in self.rules
        ]
        return {
            "schema": SCHEMA,
            "root": str(self.root.resolve()),
            "laws": {law.name: {"free": list(law.free), "machine": plain_fields(law.oscillator)} for law in self.laws},
            "rules": plain_fields(rules),
            "facts": list(self.facts),
            "fact_names": list(self.fact_names),
            "settings": plain_fields({**DEFAULTS, **self.settings}),
            "calibrated": self.calibrated,
            "versions": versions(),
        }


@functools.cache
def versions() -> Mapping[str, str]:
    """What a record says of the programs that made it."""
    import platform

    import jax

    from .. import __version__

    return {"fricjax": __version__, "jax": jax.__version__, "python": platform.python_version()}


_ANY = Rule()
DEFAULTS: Mapping[str, Any] = {
    "nuisance": None,
    "engine": "auto",
    "start": "first_reversal",
    "bounds": None,
    "priors": None,
    "tie": None,
    "guess": None,
    "loss": "squares",
    "noise": "auto",
}


@functools.cache
def _template(template: str) -> re.Pattern[str]:
    """What the end of a path is to look like, each fact being a part of one name.

    Raises:
        UsageError: a template without a fact, or with one twice.
    """
    names = _FACT.findall(template)
    if not names or len(set(names)) < len(names):
        raise UsageError(
            f"The template {template!r} names {'no fact' if not names else 'a fact twice'}; write for example "
            "'load_{load}N/run_{number}.csv'."
        )
    parts = _FACT.split(template)
    text = "".join(f"(?P<{part}>[^/]+?)" if i % 2 else re.escape(part) for i, part in enumerate(parts))
    return re.compile(rf"(?:^|/){text.replace(re.escape('*'), '[^/]*')}$")


def facts_in(templates: Sequence[str]) -> Callable[[str], dict[str, str]]:
    """What the path of a file says by the first template that it ends like; empty where it is like none."""

    def facts(file: str) -> dict[str, str]:
        return next((match.groupdict() for each in templates if (match := _template(each).search(file))), {})

    return facts
