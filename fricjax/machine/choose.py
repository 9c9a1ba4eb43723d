"""Machines from command-line options: rig, friction law and free coefficients.

All names and numbers are checked here. The oscillator itself is built later, on first use.
"""

import dataclasses
import functools
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..data.files import naming
from ..errors import UsageError, check_choice
from ..fitting.names import find_leaf
from ..fitting.settings import Model
from ..friction.catalogue import Law
from ..rig.inputs import check_restoring, checked, read_table, replaced
from ..rig.quantity import UNITS
from ..settings import ENGINES
from . import parsing
from .laws import CONTACT, coefficient_names, coefficients, summands

if TYPE_CHECKING:
    from ..oscillator import Oscillator
    from ..rig import Rig


class Bench(Protocol):
    """Command-line options of a machine, without the friction law."""

    @property
    def rig(self) -> Path | None: ...
    @property
    def fix(self) -> list[str] | None: ...
    @property
    def restoring(self) -> str | None: ...
    @property
    def mass(self) -> str | None: ...
    @property
    def stiffness(self) -> str | None: ...
    @property
    def normal_force(self) -> str | None: ...
    @property
    def drag(self) -> float | None: ...
    @property
    def engine(self) -> str: ...


class Machine(Bench, Protocol):
    """Command-line options of a machine, with the friction law."""

    @property
    def friction(self) -> str: ...


@dataclasses.dataclass(frozen=True)
class Choice:
    """The machine that the options describe.

    Attributes:
        arguments: arguments of its `Rig`.
        calibrated: whether the arguments belong to a real rig; otherwise mass and load are one.
        laws: the friction law, or its summands.
        coefficients: coefficients of each law.
        values: all coefficients with a value, by short or dotted name.
        named: names of the free coefficients; None: all coefficients that a decay determines and that are not fixed.
        fixed: names of the fixed coefficients.
        placeholder: "mass" or "stiffness" if it is unknown and must be estimated from the trace, else None.
        engine: name of the engine.
    """

    arguments: Mapping[str, Any]
    calibrated: bool
    laws: tuple[Law, ...]
    coefficients: tuple[Mapping[str, float], ...]
    values: Mapping[str, float]
    named: tuple[str, ...] | None
    fixed: tuple[str, ...]
    placeholder: str | None
    engine: str

    @property
    def model(self) -> Model:
        """Names and kinds that the checks of a fit need."""
        spring = ("k3",) if self.arguments.get("restoring") == "cubic" else ()
        holding = [law.name for law in self.laws if law.kind == "set-valued"]
        remembers = any(law.kind == "bristle" for law in self.laws)
        return Model(coefficient_names(self.laws, self.coefficients, spring), holding == ["Coulomb"], remembers)

    @property
    def rig(self) -> "Rig | None":
        """The calibrated rig, or None."""
        return self._bench if self.calibrated else None

    @functools.cached_property
    def _bench(self) -> "Rig":
        from ..rig import Rig

        return Rig(**self.arguments)

    @functools.cached_property
    def oscillator(self) -> "Oscillator":
        """The oscillator with its friction law.

        Raises:
            UsageError: a coefficient is out of bounds, or the engine cannot integrate this oscillator.
        """
        import jax
        import numpy as np

        from .. import friction
        from ..friction import Sum
        from ..oscillator.oscillator import leaves_of
        from ..oscillator.select import select_engine

        try:
            parts = [
                getattr(friction, law.name)(**numbers)
                for law, numbers in zip(self.laws, self.coefficients, strict=True)
            ]
            oscillator = self._bench.oscillator(parts[0] if len(parts) == 1 else Sum(tuple(parts)))
            leaves, names = jax.tree.leaves(oscillator), leaves_of(oscillator)
            for name, value in self.values.items():
                # The rig already contains its coefficients, with uncertainties.
                if name not in UNITS:
                    leaves[find_leaf(name, names).index] = np.asarray(value, dtype=np.float64)
            oscillator = jax.tree.unflatten(jax.tree.structure(oscillator), leaves)
            select_engine(self.engine, oscillator)
        except UsageError:
            raise
        except ValueError as error:
            raise UsageError(str(error)) from error
        return oscillator

    @functools.cached_property
    def free(self) -> tuple[str, ...]:
        """Names of the free coefficients."""
        if self.named is not None:
            return self.named
        from ..comparison.candidates import identifiable_coefficients

        names = identifiable_coefficients(self.oscillator)
        names = ["mass" if name == "stiffness" and self.placeholder == "mass" else name for name in names]
        return tuple(name for name in names if name not in self.fixed)


def choose(options: Machine, free: str | None = None, tied: Collection[str] = ()) -> Choice:
    """Choose the machine of a fit.

    Args:
        options: rig, law and fixed coefficients.
        free: free coefficients as ``mu,damping,mu_s=0.02`` with optional start values. None: mu, damping, the stiffness
            (or the mass if only the stiffness is known), and the drag of a law with drag.
        tied: coefficients that are tied to a free one.
    """
    fixed = _numbers("--fix", options.fix)
    entries = [[part.strip() for part in word.partition("=")] for word in parsing.words(free)]
    named = [name for name, _, _ in entries]
    starts = {name: parsing.number(f"--free {name}", value) for name, equals, value in entries if equals}
    for name in fixed:
        if name in named:
            raise UsageError(f"{name} is both fixed and free. Take it out of --fix or of --free.")
    if "k3" in named and "k3" not in starts:
        # The fit of a cubic spring starts from a linear one.
        starts["k3"] = 0.0
    arguments, placeholder = _arguments(options, {**fixed, **starts})
    ordinary = ["mu", "damping", placeholder or "stiffness"]
    if any("quadratic_drag" in law.coefficients for law in summands(options.friction)):
        ordinary.append("quadratic_drag")
    names = named if free is not None else [name for name in ordinary if name not in fixed]
    choice = _choice(options, options.friction, arguments, {**fixed, **starts}, {*names, *tied})
    if placeholder and placeholder not in names:
        known = "without a rig" if placeholder == "stiffness" else "without its mass"
        raise UsageError(
            f"{known.capitalize()} the {placeholder} must be free, for it comes from the trace: add it to --free."
        )
    return dataclasses.replace(choice, named=tuple(names), fixed=tuple(fixed), placeholder=placeholder)


def contenders(options: Bench, laws: Sequence[str], guess: list[str] | None = None) -> list[Choice]:
    """Choose the machines of a comparison, one for each law.

    All coefficients that a decay determines and that are not fixed are free.

    Args:
        options: rig and fixed coefficients; each applies to the laws that have the coefficient.
        laws: laws, or sums of laws joined by ``+``.
        guess: start values as ``name=value``; each applies to the laws that have the coefficient.
    """
    fixed, starts = _numbers("--fix", options.fix), _numbers("--guess", guess)
    for name in fixed:
        if name in starts:
            raise UsageError(f"{name} is fixed and has a start value. Take it out of --fix or of --guess.")
    values = {**fixed, **starts}
    sums = [summands(named) for named in laws]
    arguments, placeholder = _arguments(options, values)
    of_laws = [{name for law in parts for name in law.coefficients} for parts in sums]
    choices = []
    for named, parts, names in zip(laws, sums, of_laws, strict=True):
        # Ignore coefficients that only other laws have.
        others = set().union(*of_laws) - names
        shared = {name: value for name, value in values.items() if name.rsplit(".", 1)[-1] not in others}
        falls = any(law.falls for law in parts)
        mentioned = {*({"mu_s"} if falls else ()), *(names & set(CONTACT))}
        choice = _choice(options, named, arguments, shared, mentioned)
        choices.append(dataclasses.replace(choice, fixed=tuple(fixed), placeholder=placeholder))
    return choices


def known(options: Machine) -> Choice:
    """Choose the machine of a simulation, with a value for each coefficient."""
    fixed = _numbers("--fix", options.fix)
    arguments, placeholder = _arguments(options, fixed)
    if placeholder or not (options.rig or options.normal_force):
        raise UsageError("A simulation needs the machine: give --rig, or --mass, --stiffness and --normal-force.")
    return _choice(options, options.friction, arguments, fixed, (), complete=True)


def bench(path: Any) -> dict[str, Any]:
    """Read and check the arguments of a rig from a file."""
    table = read_table(path)
    with naming(path):
        _check_rig(table)
    return table


def _check_rig(arguments: Mapping[str, Any]) -> None:
    restoring = arguments.get("restoring", "linear")
    check_restoring(restoring)
    checked(arguments, restoring)


def _choice(
    options: Bench,
    named: str,
    arguments: Mapping[str, Any],
    values: Mapping[str, float],
    mentioned: Collection[str],
    *,
    complete: bool = False,
) -> Choice:
    """Combine rig, law and coefficients, and check the names."""
    check_choice("engine", options.engine, ENGINES)
    laws = summands(named)
    places = [None] if len(laws) == 1 else range(len(laws))
    numbers = tuple(coefficients(law, i, values, mentioned, complete) for i, law in zip(places, laws, strict=True))
    # Without the load, mu belongs to a unit load and is not a coefficient of the contact.
    calibrated = bool(options.rig or getattr(options, "normal_force", None))
    choice = Choice(arguments, calibrated, laws, numbers, values, None, (), None, options.engine)
    leaves = choice.model.leaves
    for name in [*(name for name in values if name not in UNITS), *mentioned]:
        find_leaf(name, leaves)
    return choice


def _numbers(option: str, texts: list[str] | None) -> dict[str, float]:
    values = parsing.pairs(option, texts, "v_s=1e-5")
    return {name: parsing.number(f"{option} {name}", text) for name, text in values.items()}


def _arguments(options: Bench, values: Mapping[str, float]) -> tuple[dict[str, Any], str | None]:
    """Return the arguments of the rig, and the name of the placeholder.

    The placeholder is "mass" or "stiffness" if the trace must determine it, else None.
    """
    named = {name: getattr(options, name) for name in ("mass", "stiffness", "normal_force", "restoring", "drag")}
    known: dict[str, Any] = {name: value for name, value in named.items() if value is not None}
    known |= {name: value for name, value in values.items() if name in UNITS}
    placeholder = None
    if options.rig is not None:
        known = {**bench(options.rig), **replaced(known)}
    elif options.normal_force is None and options.mass is None and options.stiffness is None:
        # With unit mass and unit load, the stiffness is omega^2 and mu is the friction per unit mass.
        placeholder = "stiffness"
        known = {"mass": 1.0, "stiffness": 1.0, "normal_force": 1.0, **replaced(known)}
    elif "normal_force" not in known or not {"mass", "stiffness", "frequency"} & set(known):
        raise UsageError("For mu both the load and the mass (or stiffness) are needed: give --normal-force and --mass.")
    elif "mass" not in known:
        # The frequency of the trace gives k/m: if one of the two is known, the other follows.
        placeholder, known["mass"] = "mass", 1.0
    elif not {"stiffness", "frequency"} & set(known):
        placeholder, known["stiffness"] = "stiffness", 1.0
    _check_rig(known)
    return known, placeholder
