"""Friction laws and their coefficients on the command line."""

from collections.abc import Collection, Mapping

from ..errors import UsageError, nearest
from ..friction.catalogue import CATALOGUE, Law, Name, check_summands, dotted, short_names

# Start values of a fit for required coefficients without a value; mu and drag are then estimated from the decay.
_STARTS = {"mu": 0.01, "v_s": 1e-4, "quadratic_drag": 0.0}
# The same for free coefficients of presliding; the record then gives a better start value.
CONTACT = {"sigma0": 1e6, "length": 1e-5}


def laws() -> dict[str, Law]:
    """Return the laws of the command line by name."""
    return {name: law for name, law in CATALOGUE.items() if not law.lists}


def find_law(name: str, known: Mapping[str, Law]) -> Law:
    """Return the law of this name among `known`."""
    word = name.strip().lower()
    if word in CATALOGUE and word not in known:
        raise UsageError(f"The law '{word}' is made in Python only, for its coefficients are lists of numbers.")
    if word not in known:
        raise UsageError(f"There is no friction law '{name}'.{nearest(word, known)} Known are {', '.join(known)}.")
    return known[word]


def summands(text: str) -> tuple[Law, ...]:
    """Return the law, or the laws joined by ``+``."""
    words = text.split("+")
    if not all(word.strip() for word in words):
        problem = f"'{text}' has no law on one side of its +" if len(words) > 1 else "names no law"
        raise UsageError(f"--friction {problem}; write for example --friction coulomb+quadraticdrag.")
    parts = tuple(find_law(word, laws()) for word in words)
    kinds = {law.kind for law in parts}
    try:
        check_summands([law.name for law in parts], jumps="set-valued" in kinds, remembers="bristle" in kinds)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return parts


def coefficients(
    law: Law, index: int | None, values: Mapping[str, float], mentioned: Collection[str], complete: bool
) -> dict[str, float]:
    """Collect the values and start values of the coefficients of a law.

    Args:
        law: the law.
        index: position in a sum; None for a single law.
        values: coefficients by short or dotted name.
        mentioned: further coefficients that must exist, such as a free mu_s.
        complete: refuse a coefficient without a value instead of choosing a start value.

    Raises:
        UsageError: a required coefficient has no value.
    """
    chosen: dict[str, float] = {}
    for name in law.coefficients:
        names = (name, f"friction.{name}" if index is None else f"friction.{index}.{name}")
        value = next((values[each] for each in names if each in values), None)
        named = value is not None or any(each in mentioned for each in names)
        required = name in law.needed
        if value is not None:
            chosen[name] = value
        elif required and complete:
            raise UsageError(f"{law.name} friction needs {name}: give it with --fix {name}=...")
        elif required and named and name in CONTACT:
            chosen[name] = CONTACT[name]
        elif required and name not in _STARTS:
            raise UsageError(f"{law.name} friction needs {name}: give it with --fix or --free {name}=...")
        elif required:
            chosen[name] = _STARTS[name]
        elif named and name == "mu_s":
            # With mu_s = mu a falling law is Coulomb's and has no gradient for the fall, so start above mu.
            chosen[name] = 1.3 * chosen.get("mu", 1.0)
        elif named and name in law.optional:
            raise UsageError(f"{name} is free: give its start value, as in --free {name}=...")
    if law.falls and "mu_s" not in chosen:
        raise UsageError(
            f"{law.name} friction without mu_s is Coulomb's law: give it with --fix mu_s=..., or free it with its "
            "start value, as in --free mu,mu_s=0.02,damping."
        )
    return chosen


def coefficient_names(
    laws: Collection[Law], named_coefficients: Collection[Collection[str]], spring: Collection[str]
) -> tuple[Name, ...]:
    """Return the coefficients of an oscillator in the order of its leaves.

    Args:
        laws: the law, or its summands.
        named_coefficients: for each law the names of the coefficients with a value.
        spring: names of the coefficients of the restoring force other than the stiffness.
    """
    machine = ("mass", "stiffness", "damping", "normal_force")
    return short_names([*machine, *dotted(laws, named_coefficients), *(f"restoring.{name}" for name in spring), "drag"])
