"""From words to a machine: the rig's values, the friction law by name, and which coefficients are free.

All that can be refused is refused here, by name and number; the oscillator itself is built when it is asked for.
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
    """A machine in words, but for its friction law; the fields are those of the options of the command line."""

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
    """A machine in words, with its friction law."""

    @property
    def friction(self) -> str: ...


@dataclasses.dataclass(frozen=True)
class Choice:
    """The machine that the options describe.

    Attributes:
        arguments: those of its `Rig`.
        calibrated: whether they are those of a real one; else mass and load are one.
        laws: its friction law, or the summands of it.
        coefficients: for each of them its coefficients.
        values: all coefficients that have a value, by short or dotted name.
        named: names of the free coefficients; None for all that a decay determines and that are not fixed.
        fixed: names of the coefficients that are not.
        placeholder: which of mass and stiffness is free to come from the trace, for it is not known.
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
        """Names and kinds, as far as a fit asks for them."""
        spring = ("k3",) if self.arguments.get("restoring") == "cubic" else ()
        holding = [law.name for law in self.laws if law.kind == "set-valued"]
        remembers = any(law.kind == "bristle" for law in self.laws)
        return Model(coefficient_names(self.laws, self.coefficients, spring), holding == ["Coulomb"], remembers)

    @property
    def rig(self) -> "Rig | None":
        """Its calibrated values; None where there are none."""
        return self._bench if self.calibrated else None

    @functools.cached_property
    def _bench(self) -> "Rig":
        from ..rig import Rig

        return Rig(**self.arguments)

    @functools.cached_property
    def oscillator(self) -> "Oscillator":
        """The machine with its law.

        Raises:
            UsageError: coefficients outside of their bounds, or an engine that cannot integrate this oscillator.
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
                # A rig knows its own coefficients already, with their uncertainties.
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
    """The machine of a fit.

    Args:
        options: rig, law and fixed coefficients.
        free: free coefficients as ``mu,damping,mu_s=0.02`` with optional start values; None for those that a decay
            determines: mu, damping, and the stiffness (or the mass, where only the stiffness is known).
        tied: coefficients that follow a free one.
    """
    fixed = _numbers("--fix", options.fix)
    entries = [[part.strip() for part in word.partition("=")] for word in parsing.words(free)]
    named = [name for name, _, _ in entries]
    starts = {name: parsing.number(f"--free {name}", value) for name, equals, value in entries if equals}
    for name in fixed:
        if name in named:
            raise UsageError(f"{name} is both fixed and free. Take it out of --fix or of --free.")
    if "k3" in named and "k3" not in starts:
        # A spring that a fit is to bend begins straight.
        starts["k3"] = 0.0
    arguments, placeholder = _arguments(options, {**fixed, **starts})
    names = named if free is not None else [n for n in ("mu", "damping", placeholder or "stiffness") if n not in fixed]
    choice = _choice(options, options.friction, arguments, {**fixed, **starts}, {*names, *tied})
    if placeholder and placeholder not in names:
        known = "without a rig" if placeholder == "stiffness" else "without its mass"
        raise UsageError(
            f"{known.capitalize()} the {placeholder} must be free, for it comes from the trace: add it to --free."
        )
    return dataclasses.replace(choice, named=tuple(names), fixed=tuple(fixed), placeholder=placeholder)


def contenders(options: Bench, laws: Sequence[str], guess: list[str] | None = None) -> list[Choice]:
    """The same machine with one law after the other; free is all that a decay determines and that is not fixed.

    Args:
        options: rig and fixed coefficients; those of a law count for the laws that have them.
        laws: laws, or sums of them joined by ``+``.
        guess: start values as ``name=value``, likewise.
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
        # What only other laws have is none of this one's concern.
        others = set().union(*of_laws) - names
        shared = {name: value for name, value in values.items() if name.rsplit(".", 1)[-1] not in others}
        falls = any(law.falls for law in parts)
        mentioned = {*({"mu_s"} if falls else ()), *(names & set(CONTACT))}
        choice = _choice(options, named, arguments, shared, mentioned)
        choices.append(dataclasses.replace(choice, fixed=tuple(fixed), placeholder=placeholder))
    return choices


def known(options: Machine) -> Choice:
    """The machine of a simulation, of which every coefficient must have a value."""
    fixed = _numbers("--fix", options.fix)
    arguments, placeholder = _arguments(options, fixed)
    if placeholder or not (options.rig or options.normal_force):
        raise UsageError("A simulation needs the machine: give --rig, or --mass, --stiffness and --normal-force.")
    return _choice(options, options.friction, arguments, fixed, (), complete=True)


def bench(path: Any) -> dict[str, Any]:
    """The arguments of the rig that a file describes."""
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
    """The rig with the law of that name and its coefficients, each of which must exist."""
    check_choice("engine", options.engine, ENGINES)
    laws = summands(named)
    places = [None] if len(laws) == 1 else range(len(laws))
    numbers = tuple(coefficients(law, i, values, mentioned, complete) for i, law in zip(places, laws, strict=True))
    # Without the load mu is that of a unit load, which is no coefficient of the contact.
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
    """The arguments of the rig, and which of mass and stiffness is a placeholder until the trace determines it."""
    named = {name: getattr(options, name) for name in ("mass", "stiffness", "normal_force", "restoring", "drag")}
    known: dict[str, Any] = {name: value for name, value in named.items() if value is not None}
    known |= {name: value for name, value in values.items() if name in UNITS}
    placeholder = None
    if options.rig is not None:
        known = {**bench(options.rig), **replaced(known)}
    elif options.normal_force is None and options.mass is None and options.stiffness is None:
        # Of unit mass under unit load its stiffness is omega^2, its mu the friction per unit mass.
        placeholder = "stiffness"
        known = {"mass": 1.0, "stiffness": 1.0, "normal_force": 1.0, **replaced(known)}
    elif "normal_force" not in known or not {"mass", "stiffness", "frequency"} & set(known):
        raise UsageError("For mu both the load and the mass (or stiffness) are needed: give --normal-force and --mass.")
    elif "mass" not in known:
        # The trace knows k/m: with one of the two known, the other comes from the frequency.
        placeholder, known["mass"] = "mass", 1.0
    elif not {"stiffness", "frequency"} & set(known):
        placeholder, known["stiffness"] = "stiffness", 1.0
    _check_rig(known)
    return known, placeholder
