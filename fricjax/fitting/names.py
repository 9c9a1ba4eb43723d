"""Names of coefficients, and which sets of them a trace can determine."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import UsageError, nearest

if TYPE_CHECKING:
    from ..friction import AbstractFriction, Coulomb

NUISANCES = {"x0": "m", "v0": "m/s", "offset": "m", "drift": "m/s", "t_release": "s", "z0": ""}

_SAME_FORCE = (
    ("mass", "stiffness", "the motion depends only on their ratio, the natural frequency"),
    ("mu", "normal_force", "the motion depends only on their product, the friction force"),
    ("drag", "quadratic_drag", "both are the same force, quadratic in the velocity"),
    ("damping", "eta_h", "at one frequency both take the same share of the energy in each half-cycle"),
    ("damping", "sigma2", "both are the same force, linear in the velocity"),
)


def of_run(name: str) -> bool:
    """Return True for a parameter of a run, such as "x0[2]"."""
    return name.split("[")[0] in NUISANCES


class Named(Protocol):
    """Object with a short and a dotted name, such as a leaf."""

    @property
    def name(self) -> str: ...

    @property
    def dotted(self) -> str: ...


def find_leaf[L: Named](name: str, leaves: Sequence[L]) -> L:
    """Return the leaf with this short or dotted name.

    Raises:
        UsageError: no such leaf, or an ambiguous short name.
    """
    for leaf in leaves:
        if name in (leaf.name, leaf.dotted):
            return leaf
    twins = [leaf.dotted for leaf in leaves if leaf.dotted.endswith(f".{name}")]
    if twins:
        raise UsageError(f"{name!r} is ambiguous here: say which one, {' or '.join(twins)}.")
    known = [leaf.name for leaf in leaves]
    if name == "mu_s" and "mu" in known:
        raise UsageError("This law has no separate mu_s: it is tied to mu. Set one, such as mu_s=0.1.")
    raise UsageError(f"This oscillator has no coefficient {name!r}.{nearest(name, known)} It has {', '.join(known)}.")


def sole_coulomb(law: "AbstractFriction") -> "Coulomb | None":
    """Return the Coulomb law that holds the mass at rest, if unique.

    Its static coefficient can be bracketed.
    """
    from ..friction import Coulomb
    from ..friction.base import laws_of

    holding = [part for part in laws_of(law) if part.set_valued]
    return holding[0] if len(holding) == 1 and isinstance(holding[0], Coulomb) else None


def chosen[L: Named](free: Sequence[str], leaves: Sequence[L], bracketable: bool) -> tuple[list[L], str | None]:
    """Return the leaves to fit, and the bracketed static coefficient's name.

    The static coefficient of a Coulomb law has no gradient, so it is not fitted.

    Args:
        free: names of the free coefficients.
        leaves: all coefficients.
        bracketable: True if the static coefficient is bracketed, not fitted.

    Raises:
        UsageError: no free name, an unknown or repeated name, or coefficients that no trace can separate.
    """
    if not free:
        raise UsageError(f"Nothing is free. Name at least one of {', '.join(leaf.name for leaf in leaves)}.")
    named = [find_leaf(name, leaves) for name in free]
    if len(set(named)) < len(named):
        raise UsageError(f"A parameter is named twice in free={list(free)}.")
    check_identifiable([leaf.name for leaf in named], leaves)
    static = [leaf for leaf in named if bracketable and leaf.dotted.endswith("mu_s")]
    kept = [leaf for leaf in named if leaf not in static]
    if not kept:
        raise UsageError("mu_s of a Coulomb law is bracketed from stops, not fitted. Free mu as well.")
    return kept, static[0].name if static else None


def tied[L: Named](tie: Mapping[str, Any], leaves: Sequence[L], names: Sequence[str]) -> list[tuple[L, str, float]]:
    """Return tied leaves, each with its free parameter and a factor.

    The input is {leaf: name} or {leaf: (name, factor)}.

    Raises:
        UsageError: an unknown leaf or parameter, or a leaf that is free itself.
    """
    ties = []
    for target, source in tie.items():
        leaf = find_leaf(target, leaves)
        name, factor = source if isinstance(source, tuple | list) else (source, 1.0)
        if leaf.name in names:
            raise UsageError(f"{target} is tied to {name} and cannot be free as well. Take it out of free=.")
        check_names({name: None}, names, "Ties")
        ties.append((leaf, name, float(factor)))
    return ties


def check_identifiable(free: Iterable[str], leaves: Sequence[Named]) -> None:
    """Refuse sets of free parameters that no trace can separate.

    Raises:
        UsageError: names the pair and says why.
    """
    kinds = [name.rsplit(".", 1)[-1] for name in free]
    present = {leaf.name.rsplit(".", 1)[-1] for leaf in leaves}
    if "quadratic_drag" in present and "drag" in kinds:
        raise UsageError(
            "drag cannot be free together with a quadratic-drag law: both are the same force. Leave one of them out."
        )
    for first, second, reason in _SAME_FORCE:
        if first in kinds and second in kinds:
            raise UsageError(
                f"{first} and {second} cannot both be free, for they are not identifiable: {reason}. Fix one of them."
            )
        for kind in (first, second):
            if kinds.count(kind) > 1 and kind not in ("mu",):
                raise UsageError(f"{kind} is free twice, for the same force. Free it once.")


def check_names(entries: Mapping[str, object], allowed: Sequence[str], role: str) -> None:
    """Refuse entries for parameters that are not free.

    Raises:
        UsageError: names the first such entry and the nearest free parameter.
    """
    for name in entries:
        if name not in allowed:
            raise UsageError(
                f"{role} are given for {name!r}, which is not a free parameter.{nearest(name, allowed)} "
                f"Free are {', '.join(allowed)}."
            )
