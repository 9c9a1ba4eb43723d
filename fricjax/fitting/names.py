"""Names of coefficients: which leaf of an oscillator is meant, and which of them a trace can tell apart."""

from collections.abc import Iterable, Mapping, Sequence

from ..data.errors import UsageError, nearest
from ..friction import AbstractFriction, Coulomb, Sum
from ..oscillator.leaves import Leaf

NUISANCES = {"x0": "m", "v0": "m/s", "offset": "m", "drift": "m/s", "t_release": "s", "z0": ""}

_SAME_FORCE = (
    ("mass", "stiffness", "a trace tells only their ratio, the natural frequency"),
    ("mu", "normal_force", "a trace tells only their product, the friction force"),
    ("drag", "windage", "both are the same force, quadratic in the velocity"),
    ("damping", "eta_h", "at one frequency both take the same share of the energy in each half-cycle"),
    ("damping", "sigma2", "both are the same force, linear in the velocity"),
)


def find_leaf(name: str, leaves: Sequence[Leaf]) -> Leaf:
    """The leaf of that name, short or dotted.

    Raises:
        UsageError: no such leaf, or one whose short name is ambiguous.
    """
    for leaf in leaves:
        if name in (leaf.name, leaf.dotted):
            return leaf
    twins = [leaf.dotted for leaf in leaves if leaf.dotted.endswith(f".{name}")]
    if twins:
        raise UsageError(f"{name!r} is ambiguous here: say which one, {' or '.join(twins)}.")
    known = [leaf.name for leaf in leaves]
    if name == "mu_s" and "mu" in known:
        raise UsageError("This law has no mu_s of its own: it is tied to mu. Give the law one, such as mu_s=0.1.")
    raise UsageError(f"This oscillator has no coefficient {name!r}.{nearest(name, known)} It has {', '.join(known)}.")


def sole_coulomb(law: AbstractFriction) -> Coulomb | None:
    """The Coulomb law that alone holds the mass at rest, if it does: its static coefficient can be bracketed."""
    holding = [part for part in (law.laws if isinstance(law, Sum) else (law,)) if part.set_valued]
    return holding[0] if len(holding) == 1 and isinstance(holding[0], Coulomb) else None


def check_identifiable(free: Iterable[str], leaves: Sequence[Leaf]) -> None:
    """Refuse sets of free parameters of which no trace can tell one from the other.

    Raises:
        UsageError: names the pair and says why.
    """
    kinds = [name.rsplit(".", 1)[-1] for name in free]
    present = {leaf.name.rsplit(".", 1)[-1] for leaf in leaves}
    if "windage" in present and "drag" in kinds:
        raise UsageError(
            "drag cannot be free beside a law with windage: both are the same force. Leave one of them out."
        )
    for first, second, reason in _SAME_FORCE:
        if first in kinds and second in kinds:
            raise UsageError(
                f"{first} and {second} cannot both be free, for they are not identifiable: {reason}. Fix one of them."
            )
        for kind in (first, second):
            if kinds.count(kind) > 1 and kind not in ("mu",):
                raise UsageError(f"{kind} is free twice, for the same force. Free it once.")


def check_names(given: Mapping[str, object], allowed: Sequence[str], role: str) -> None:
    """Refuse entries for parameters that are not free.

    Raises:
        UsageError: names the first such entry and the nearest free parameter.
    """
    for name in given:
        if name not in allowed:
            raise UsageError(
                f"{role} are given for {name!r}, which is not a free parameter.{nearest(name, allowed)} "
                f"Free are {', '.join(allowed)}."
            )
