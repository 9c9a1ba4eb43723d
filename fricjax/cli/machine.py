"""From the options to an oscillator: the rig's values, the friction law by name, and which coefficients are free."""

import dataclasses
import inspect
from collections.abc import Collection, Mapping, Sequence
from typing import Any, get_origin

import jax
import numpy as np

from .. import friction
from ..calibrate import Rig
from ..calibrate.quantity import UNITS
from ..comparison.candidates import telling
from ..data.errors import UsageError, nearest
from ..fitting.names import find_leaf
from ..friction import AbstractFriction, Sum
from ..friction.falling import AbstractFalling
from ..oscillator import Oscillator
from ..oscillator.engines import AbstractEngine
from ..oscillator.leaves import leaves_of
from ..oscillator.select import select_engine
from . import parsing
from .options import Bench, Machine

# Where a law asks for a coefficient that nobody gave, a fit begins here; mu and windage are then found from the decay.
_STARTS = {"mu": 0.01, "v_s": 1e-4, "windage": 0.0}
# The same for what bends before it slides, where it is free: the record then tells where to begin.
_CONTACT = {"sigma0": 1e6, "length": 1e-5}


def laws() -> dict[str, type[AbstractFriction]]:
    """The friction laws by their names on the command line: those that a few numbers describe."""
    return {name: law for name, law in catalogue().items() if not _has_lists(law)}


def catalogue() -> dict[str, type[AbstractFriction]]:
    """All friction laws by their names in small letters, without their sums."""
    members: dict[str, Any] = {name.lower(): getattr(friction, name) for name in friction.__all__}
    return {name: law for name, law in members.items() if not inspect.isabstract(law) and law is not Sum}


def find_law(name: str, known: Mapping[str, type[AbstractFriction]]) -> type[AbstractFriction]:
    """The law of that name among those `known`.

    Raises:
        UsageError: no such law.
    """
    word = name.strip().lower()
    if word not in known:
        raise UsageError(f"There is no friction law '{name}'.{nearest(word, known)} Known are {', '.join(known)}.")
    return known[word]


def _summands(named: str) -> list[type[AbstractFriction]]:
    return [find_law(word, laws()) for word in named.split("+")]


def _has_lists(law: type[AbstractFriction]) -> bool:
    return any(get_origin(field.type) is tuple for field in dataclasses.fields(law))


@dataclasses.dataclass(frozen=True)
class Choice:
    """The machine that the options describe.

    Attributes:
        oscillator: the machine with its law.
        rig: its calibrated values; None where none was given and mass and load are one.
        free: names of the free coefficients.
    """

    oscillator: Oscillator
    rig: Rig | None
    free: tuple[str, ...]


def choose(options: Machine, free: str | None = None, tied: Collection[str] = ()) -> Choice:
    """The machine of a fit.

    Args:
        options: rig, law and fixed coefficients.
        free: free coefficients as ``mu,damping,mu_s=0.02`` with optional start values; None for those that a decay
            determines: mu, damping, and the stiffness (or the mass, where only the stiffness is known).
        tied: coefficients that follow a free one.

    Raises:
        UsageError: unknown names or values that do not fit.
    """
    fixed = _numbers("--fix", options.fix)
    named, starts = _free(free)
    for name in fixed:
        if name in named:
            raise UsageError(f"{name} is both fixed and free. Take it out of --fix or of --free.")
    rig, placeholder = _rig(options, {**fixed, **starts})
    names = named if free is not None else [n for n in ("mu", "damping", placeholder or "stiffness") if n not in fixed]
    oscillator = assemble(rig, options.friction, {**fixed, **starts}, {*names, *tied})
    if placeholder and placeholder not in names:
        known = "without a rig" if placeholder == "stiffness" else "without its mass"
        raise UsageError(
            f"{known.capitalize()} the {placeholder} must be free, for it comes from the trace: add it to --free."
        )
    calibrated = options.rig or options.normal_force
    return Choice(oscillator, rig if calibrated else None, tuple(names))


def contenders(options: Bench, laws: Sequence[str], guess: list[str] | None = None) -> list[Choice]:
    """The same machine with one law after the other; free is all that a decay can tell and that is not fixed.

    Args:
        options: rig and fixed coefficients; those of a law count for the laws that have them.
        laws: laws, or sums of them joined by ``+``.
        guess: start values as ``name=value``, likewise.

    Raises:
        UsageError: unknown names or values that do not fit.
    """
    fixed, starts = _numbers("--fix", options.fix), _numbers("--guess", guess)
    for name in fixed:
        if name in starts:
            raise UsageError(f"{name} is fixed and has a start value. Take it out of --fix or of --guess.")
    values = {**fixed, **starts}
    rig, placeholder = _rig(options, values)
    calibrated = rig if options.rig or options.normal_force else None
    kinds = [_summands(named) for named in laws]
    of_laws = [{name for kind in parts for name in kind.coefficients} for parts in kinds]
    choices = []
    for named, parts, own in zip(laws, kinds, of_laws, strict=True):
        others = set().union(*of_laws) - own
        mine = {name: value for name, value in values.items() if name.rsplit(".", 1)[-1] not in others}
        falls = any(issubclass(kind, AbstractFalling) for kind in parts)
        oscillator = assemble(rig, named, mine, {*({"mu_s"} if falls else ()), *(own & set(_CONTACT))})
        free = ["mass" if name == "stiffness" and placeholder == "mass" else name for name in telling(oscillator)]
        choices.append(Choice(oscillator, calibrated, tuple(name for name in free if name not in fixed)))
    return choices


def known(options: Machine) -> Oscillator:
    """The machine of a simulation, of which every coefficient must be given.

    Raises:
        UsageError: a coefficient that is missing, unknown, or does not fit.
    """
    fixed = _numbers("--fix", options.fix)
    rig, placeholder = _rig(options, fixed)
    if placeholder or not (options.rig or options.normal_force):
        raise UsageError("A simulation needs the machine: give --rig, or --mass, --stiffness and --normal-force.")
    return assemble(rig, options.friction, fixed, (), complete=True)


def assemble(
    rig: Rig, named: str, values: Mapping[str, float], mentioned: Collection[str], *, complete: bool = False
) -> Oscillator:
    """The rig's oscillator with the law of that name and the given coefficients.

    Args:
        rig: the machine; coefficients that it holds itself are taken from there.
        named: law, or laws joined by ``+``.
        values: coefficients by short or dotted name.
        mentioned: further coefficients that must exist, such as a free mu_s.
        complete: refuse coefficients without a value instead of starting somewhere.
    """
    kinds = _summands(named)
    places = [None] if len(kinds) == 1 else range(len(kinds))
    try:
        made = [_instance(kind, i, values, mentioned, complete) for i, kind in zip(places, kinds, strict=True)]
        law = made[0] if len(made) == 1 else Sum(tuple(made))
    except ValueError as error:
        raise UsageError(str(error)) from error
    oscillator = rig.oscillator(law)
    leaves, found = jax.tree.leaves(oscillator), leaves_of(oscillator)
    for name, value in values.items():
        if name not in UNITS:
            leaves[find_leaf(name, found).index] = np.asarray(value, dtype=np.float64)
    for name in mentioned:
        find_leaf(name, found)
    return jax.tree.unflatten(jax.tree.structure(oscillator), leaves)


def engine(name: str, oscillator: Oscillator) -> AbstractEngine:
    """The engine of that name.

    Raises:
        UsageError: no such engine, or one that cannot integrate this oscillator.
    """
    try:
        return select_engine(name, oscillator)
    except ValueError as error:
        raise UsageError(str(error)) from error


def _numbers(option: str, given: list[str] | None) -> dict[str, float]:
    found = parsing.pairs(option, given, "v_s=1e-5")
    return {name: parsing.number(f"{option} {name}", text) for name, text in found.items()}


def _free(text: str | None) -> tuple[list[str], dict[str, float]]:
    """Names of the free coefficients, and the start values written with them."""
    entries = [word.partition("=") for word in parsing.words(text)]
    starts = {
        name.strip(): parsing.number(f"--free {name.strip()}", value) for name, equals, value in entries if equals
    }
    return [name.strip() for name, _, _ in entries], starts


def _rig(options: Bench, values: Mapping[str, float]) -> tuple[Rig, str | None]:
    """The rig, and which of mass and stiffness is only a placeholder until the trace tells it."""
    own = {name: getattr(options, name) for name in ("mass", "stiffness", "normal_force", "restoring", "drag")}
    given = {name: value for name, value in own.items() if value is not None}
    given |= {name: value for name, value in values.items() if name in UNITS}
    if options.rig is not None:
        return Rig.from_toml(options.rig).replace(**given), None
    if options.normal_force is None and options.mass is None and options.stiffness is None:
        return _normalised(given), "stiffness"
    if "normal_force" not in given or not {"mass", "stiffness", "frequency"} & set(given):
        raise UsageError("For mu both the load and the mass (or stiffness) are needed: give --normal-force and --mass.")
    stiff = {"stiffness", "frequency"} & set(given)
    if "mass" in given:
        return Rig(**(given if stiff else {**given, "stiffness": 1.0})), None if stiff else "stiffness"
    return Rig(**{**given, "mass": 1.0}), "mass"


def _normalised(given: Mapping[str, Any]) -> Rig:
    """A machine of unit mass under unit load: its stiffness is omega^2, its mu the friction per unit mass."""
    return Rig(mass=1.0, stiffness=1.0, normal_force=1.0).replace(**given)


def _instance(
    kind: type[AbstractFriction],
    index: int | None,
    values: Mapping[str, float],
    mentioned: Collection[str],
    complete: bool,
) -> AbstractFriction:
    """One law with the coefficients given, and placeholders for those that are free or found from the decay."""
    arguments: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        names = (field.name, f"friction.{field.name}" if index is None else f"friction.{index}.{field.name}")
        given = [values[name] for name in names if name in values]
        named = given or any(name in mentioned for name in names)
        required = field.default is dataclasses.MISSING
        if given:
            arguments[field.name] = given[0]
        elif required and complete:
            raise UsageError(f"{kind.__name__} friction needs {field.name}: give it with --fix {field.name}=...")
        elif required and named and field.name in _CONTACT:
            arguments[field.name] = _CONTACT[field.name]
        elif required and field.name not in _STARTS:
            raise UsageError(
                f"{kind.__name__} friction needs {field.name}: give it with --fix or --free {field.name}=..."
            )
        elif required:
            arguments[field.name] = _STARTS[field.name]
        elif named and field.name == "mu_s":
            arguments[field.name] = 1.3 * arguments.get("mu", 1.0)
        elif named and field.default is None:
            raise UsageError(f"{field.name} is free: give its start value, as in --free {field.name}=...")
    _check_fall(kind, arguments)
    return kind(**arguments)


def _check_fall(kind: type[AbstractFriction], arguments: Mapping[str, float]) -> None:
    if issubclass(kind, AbstractFalling) and "mu_s" not in arguments:
        raise UsageError(
            f"{kind.__name__} friction without mu_s is Coulomb's law: give it with --fix mu_s=..., or free it with its "
            "start value, as in --free mu,mu_s=0.02,damping."
        )
