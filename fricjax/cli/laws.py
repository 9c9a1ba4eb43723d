"""Friction laws as the command line names them, and the coefficients that it gives them."""

from collections.abc import Collection, Mapping

from ..errors import UsageError, nearest
from ..friction.catalogue import CATALOGUE, Law, check_summands

# Where a law asks for a coefficient that nobody gave, a fit begins here; mu and the drag follow from the decay.
_STARTS = {"mu": 0.01, "v_s": 1e-4, "quadratic_drag": 0.0}
# The same for what bends before it slides, where it is free: the record then tells where to begin.
CONTACT = {"sigma0": 1e6, "length": 1e-5}


def laws() -> dict[str, Law]:
    """The friction laws by their names on the command line: those that a few numbers describe."""
    return {name: law for name, law in CATALOGUE.items() if not law.lists}


def find_law(name: str, known: Mapping[str, Law]) -> Law:
    """The law of that name among those `known`.

    Raises:
        UsageError: no such law.
    """
    word = name.strip().lower()
    if word in CATALOGUE and word not in known:
        raise UsageError(f"The law '{word}' is made in Python only, for its coefficients are lists of numbers.")
    if word not in known:
        raise UsageError(f"There is no friction law '{name}'.{nearest(word, known)} Known are {', '.join(known)}.")
    return known[word]


def summands(named: str) -> tuple[Law, ...]:
    """The law, or the laws joined by ``+``.

    Raises:
        UsageError: no such law, nothing beside a ``+``, or laws that no engine integrates together.
    """
    words = named.split("+")
    if not all(word.strip() for word in words):
        lacking = f"'{named}' lacks a law beside its +" if len(words) > 1 else "names no law"
        raise UsageError(f"--friction {lacking}; write for example --friction coulomb+quadraticdrag.")
    found = tuple(find_law(word, laws()) for word in words)
    kinds = {law.kind for law in found}
    try:
        check_summands([law.name for law in found], jumps="set-valued" in kinds, remembers="bristle" in kinds)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return found


def arguments(
    law: Law, index: int | None, values: Mapping[str, float], mentioned: Collection[str], complete: bool
) -> dict[str, float]:
    """The coefficients of a law as given, and placeholders for those that are free or found from the decay.

    Args:
        law: the law.
        index: its place in a sum, None where it stands alone.
        values: coefficients by short or dotted name.
        mentioned: further coefficients that must exist, such as a free mu_s.
        complete: refuse coefficients without a value instead of starting somewhere.

    Raises:
        UsageError: a coefficient that is needed.
    """
    found: dict[str, float] = {}
    for own in law.coefficients:
        names = (own, f"friction.{own}" if index is None else f"friction.{index}.{own}")
        given = [values[name] for name in names if name in values]
        named = given or any(name in mentioned for name in names)
        required = own in law.needed
        if given:
            found[own] = given[0]
        elif required and complete:
            raise UsageError(f"{law.name} friction needs {own}: give it with --fix {own}=...")
        elif required and named and own in CONTACT:
            found[own] = CONTACT[own]
        elif required and own not in _STARTS:
            raise UsageError(f"{law.name} friction needs {own}: give it with --fix or --free {own}=...")
        elif required:
            found[own] = _STARTS[own]
        elif named and own == "mu_s":
            found[own] = 1.3 * found.get("mu", 1.0)
        elif named and own in law.optional:
            raise UsageError(f"{own} is free: give its start value, as in --free {own}=...")
    if law.falls and "mu_s" not in found:
        raise UsageError(
            f"{law.name} friction without mu_s is Coulomb's law: give it with --fix mu_s=..., or free it with its "
            "start value, as in --free mu,mu_s=0.02,damping."
        )
    return found
