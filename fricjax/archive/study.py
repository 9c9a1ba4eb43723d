"""Study of an archive: files, readers, rigs, laws and fit settings.

A study consists of plain data, rigs and laws, so it can be sent to workers unchanged. A digest of all settings that
affect the result of a run distinguishes its records.
"""

import dataclasses
import functools
import hashlib
import json
import math
import platform
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import DataError, UsageError

if TYPE_CHECKING:
    from ..fitting.parameters import Request
    from ..oscillator import Oscillator
    from ..rig import Rig

SCHEMA = "fricjax.archive/1"
"""Version of the table's columns and of the records; a change requires new fits."""

# A fact in a template, such as {load} in "load_{load}N/run_{number}.csv".
_FACT = re.compile(r"\{([a-z_][a-z_0-9]*)\}")


@dataclasses.dataclass(frozen=True, eq=False)
class Law:
    """Friction law that is fitted to every run.

    Attributes:
        name: name on the command line, such as "coulomb" or "coulomb+quadraticdrag".
        oscillator: oscillator with that law; for a rule with a rig, only the friction law is used.
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


def name_of(oscillator: "Oscillator") -> str:
    """Return the command-line name of the friction law, such as "coulomb+quadraticdrag"."""
    from ..friction.base import law_name

    return law_name(oscillator.friction).replace(" ", "").lower()


@dataclasses.dataclass(frozen=True, eq=False)
class Rule:
    """Reader options and rig for the files of a pattern.

    Attributes:
        pattern: pattern of files relative to the folder of the study, such as "lab_b/**/*.csv".
        reading: options of `fricjax.read`.
        rig: the rig; None if there is no rig.
        rig_name: name of its file.

    Examples:
        >>> import fricjax as fj
        >>> fj.archive.Rule("lab_b/**/*.csv", {"unit": "um"}).reading
        {'unit': 'um'}
    """

    pattern: str = "**"
    reading: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    rig: "Rig | None" = None
    rig_name: str = ""

    def inputs(self) -> dict[str, list[float]]:
        """Return value and standard uncertainty of each number of the rig."""
        return {} if self.rig is None else {n: [m.value, m.std] for n, m in self.rig.numbers().items()}


# Regular expressions of wildcards, folders before names.
_SIGNS = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}


def matches(file: str, pattern: str) -> bool:
    """Return True if a path matches a pattern."""
    parts = re.split(r"(\*\*/|\*\*|\*|\?)", pattern)
    return re.fullmatch("".join(_SIGNS.get(part, re.escape(part)) for part in parts), file, re.DOTALL) is not None


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """Files, models and settings of a batch fit.

    Attributes:
        root: folder that the paths of the runs are relative to.
        laws: friction laws, each fitted to every run.
        files: runs relative to `root`; None for all files that match `include`.
        include, exclude: patterns of files in the folder; without `include`, all files with a known suffix.
        rules: reader options and rigs; the first matching rule applies. A file without a matching rule has no options
            and no rig.
        facts: path templates, such as "load_{load}N/run_{number}.csv"; each fact becomes a column, and a load the
            normal force [N].
        settings: further keywords of `fricjax.fit_batch`: `start`, `bounds`, `priors`, ...
        calibrated: whether mass and load of the laws are those of a real machine; otherwise only runs with a rig have a
            coefficient of friction.
        residuals: whether to write the residuals of every run as netCDF.

    Examples:
        >>> import fricjax as fj
        >>> from pathlib import Path
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> law = fj.archive.Law("coulomb", machine, ("mu", "damping", "stiffness"))
        >>> study = fj.archive.Study(Path("runs"), (law,), facts=("load_{load}N/run_{number}.csv",))
        >>> study.facts_of("steel/load_9.66N/run_07.csv")
        {'load': '9.66', 'number': '07'}
        >>> study.load_of("load_9.66N/run_07.csv")
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
        """Return the first rule that matches a file."""
        return next((rule for rule in self.rules if matches(file, rule.pattern)), _ANY)

    def facts_of(self, file: str) -> dict[str, str]:
        """Extract facts from a path by the first matching template, else none."""
        return facts_in(self.facts, file)

    def load_of(self, file: str) -> float:
        """Return the normal force of a run [N], NaN if unknown.

        It comes from its path, its rig or the study, in this order.

        Raises:
            DataError: the load in its path is not a positive number.
        """
        text = self.facts_of(file).get("load")
        if text is not None:
            try:
                load = float(text.replace(",", "."))
            except ValueError:
                load = math.nan
            if not 0 < load < math.inf:
                raise DataError(
                    f"Its path names the load {text!r}, which is no positive number of newtons. Rename it, or change "
                    "the template in facts=."
                )
            return load
        rig = self.rule_of(file).rig
        if rig is not None:
            return rig.normal_force.value
        return float(self.laws[0].oscillator.normal_force) if self.calibrated else math.nan

    def request(self, law: Law, rule: Rule, load: float) -> "Request":
        """Return the fit request for a rule's runs under a load."""
        from ..fitting.parameters import Request

        rig = rule.rig
        machine = law.oscillator if rig is None else rig.oscillator(law.oscillator.friction)
        if math.isfinite(load) and load != float(machine.normal_force):
            machine = dataclasses.replace(machine, normal_force=load)
            rig = None if rig is None else rig.with_inputs({"normal_force": load})
        return Request.of(machine, law.free, rig=rig, **{**DEFAULTS, **self.settings})

    def settings_of(self, law: Law, file: str) -> str:
        """Return the digest of the settings of a run with any load."""
        try:
            load = self.load_of(file)
        except DataError:
            load = -math.inf
        return self.digest(law, self.rule_of(file), load)

    @functools.lru_cache(maxsize=4096)  # noqa: B019 - a process has few studies
    def digest(self, law: Law, rule: Rule, load: float) -> str:
        """Return a digest of all settings that affect a run's result."""
        from ..fitting.store import plain_fields

        rig = (None, None) if rule.rig is None else (rule.inputs(), type(rule.rig.restoring).__name__)
        known = [law.name, law.oscillator, list(law.free), dict(rule.reading), *rig, load, self.calibrated]
        parts = plain_fields([*known, {**DEFAULTS, **self.settings}])
        return hashlib.sha256(json.dumps([SCHEMA, *parts], sort_keys=True, default=repr).encode()).hexdigest()[:32]

    def described(self) -> dict[str, Any]:
        """Describe the study as JSON data for the store."""
        from ..fitting.store import plain_fields

        rules = [
            {"pattern": rule.pattern, "reading": dict(rule.reading), "rig": rule.rig_name, "inputs": rule.inputs()}
            for rule in self.rules
        ]
        return {
            "schema": SCHEMA,
            "root": str(self.root.resolve()),
            "laws": {law.name: {"free": list(law.free), "machine": plain_fields(law.oscillator)} for law in self.laws},
            "rules": plain_fields(rules),
            "facts": list(self.facts),
            "settings": plain_fields({**DEFAULTS, **self.settings}),
            "calibrated": self.calibrated,
            "versions": versions(),
        }


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the versions of the programs for a record."""
    import jax

    from .. import __version__

    return {"fricjax": __version__, "jax": jax.__version__, "python": platform.python_version()}


_ANY = Rule()
DEFAULTS: Mapping[str, Any] = {
    **dict.fromkeys(("nuisance", "bounds", "priors", "tie", "guess")),
    "engine": "auto",
    "start": "first_reversal",
    "loss": "squares",
    "noise": "auto",
}


@functools.cache
def _template(template: str) -> re.Pattern[str]:
    """Compile a template to a regular expression for path ends."""
    names = _FACT.findall(template)
    if not names or len(set(names)) < len(names):
        raise UsageError(
            f"The template {template!r} names {'no fact' if not names else 'a fact twice'}; write for example "
            "'load_{load}N/run_{number}.csv'."
        )
    parts = _FACT.split(template)
    text = "".join(f"(?P<{part}>[^/]+?)" if i % 2 else re.escape(part) for i, part in enumerate(parts))
    return re.compile(rf"(?:^|/){text.replace(re.escape('*'), '[^/]*')}$")


def facts_in(templates: Sequence[str], file: str) -> dict[str, str]:
    """Extract facts from a path by the first matching template, else none."""
    return next((match.groupdict() for each in templates if (match := _template(each).search(file))), {})
