"""Catalogue of the friction laws and their coefficients, without imports of JAX.

With it a misspelt name is refused before JAX is imported. `tests/friction/test_catalogue.py` compares this table with
the classes.
"""

import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

type Kind = Literal["set-valued", "smooth", "bristle"]


@dataclasses.dataclass(frozen=True)
class Law:
    """Name, kind and coefficients of a law.

    Attributes:
        name: name of the class.
        kind: "set-valued", "smooth" or "bristle" (with internal states), see :mod:`fricjax.friction.kinds`.
        needed: required coefficients.
        optional: coefficients that the law has only if they are passed.
        coefficients: all coefficients, in the order of the class.
        falls: whether the law is Coulomb's law without a static coefficient.
        lists: whether some coefficients are lists of numbers, which a command-line option cannot hold.
    """

    name: str
    kind: Kind
    needed: tuple[str, ...]
    optional: tuple[str, ...]
    coefficients: tuple[str, ...]
    falls: bool = False
    lists: bool = False

    def present(self, passed: Collection[str]) -> tuple[str, ...]:
        """Coefficients of the law if these are passed."""
        return tuple(name for name in self.coefficients if name not in self.optional or name in passed)


def _law(name: str, kind: Kind, written: str, **more: bool) -> Law:
    """Build a law from text.

    In the text ``mu`` is required, ``mu_s?`` is optional, and ``exponent=`` has a default.
    """
    words = written.split()
    names = tuple(word.rstrip("?=") for word in words)
    needed = tuple(word for word in words if word[-1] not in "?=")
    return Law(name, kind, needed, tuple(word[:-1] for word in words if word[-1] == "?"), names, **more)


_ALL = (
    _law("Ageing", "set-valued", "mu beta dwell mu_s? dwell_scale="),
    _law("BlimanSorine", "bristle", "mu1 mu2 eta epsilon"),
    _law("BoucWen", "bristle", "mu sigma0 n= beta="),
    _law("Coulomb", "set-valued", "mu mu_s?"),
    _law("Dahl", "bristle", "mu sigma0 exponent="),
    _law("ElastoPlastic", "bristle", "mu mu_s? v_stribeck= sigma0= sigma1= sigma2= breakaway_fraction= v_damping?"),
    _law("GeneralisedMaxwellSlip", "bristle", "mu mu_s v_stribeck stiffnesses shares attraction sigma2", lists=True),
    _law("Jenkins", "bristle", "mu sigma0="),
    _law("Leuven", "bristle", "mu mu_s v_stribeck stiffnesses shares exponent sigma1 sigma2", lists=True),
    _law("LoadDependent", "set-valued", "mu exponent= reference_load= adhesion="),
    _law("Lorentzian", "set-valued", "mu mu_s? v_stribeck= exponent=", falls=True),
    _law("LuGre", "bristle", "mu mu_s? v_stribeck= sigma0= sigma1= sigma2= v_damping?"),
    _law("Makkar", "smooth", "gamma1 gamma2 gamma3 gamma4 gamma5 gamma6="),
    _law("MaxwellSlip", "bristle", "stiffnesses limits", lists=True),
    _law("MonotoneSpline", "set-valued", "knots forces", lists=True),
    _law("QuadraticDrag", "smooth", "quadratic_drag"),
    _law("RateState", "bristle", "mu a b slip_distance v_reference="),
    _law("RateStateSlip", "bristle", "mu a b slip_distance v_reference="),
    _law("Rolling", "bristle", "mu length load_exponent= reference_load="),
    _law("Spline", "set-valued", "knots forces", lists=True),
    _law("Stribeck", "set-valued", "mu mu_s? v_stribeck= exponent=", falls=True),
    _law("Tanh", "smooth", "mu v_s"),
    _law("Viscous", "smooth", "sigma2"),
)
CATALOGUE: Mapping[str, Law] = {law.name.lower(): law for law in _ALL}
"""All laws by their names in lower case, without sums."""


def check_summands(names: Collection[str], *, jumps: bool, remembers: bool) -> None:
    """Refuse a sum that no engine can integrate.

    Args:
        names: names of the summands.
        jumps: whether one of them is set-valued.
        remembers: whether one of them has internal states.

    Raises:
        ValueError: the sum has both; the message names the laws.
    """
    if jumps and remembers:
        raise ValueError(
            f"{' + '.join(names)} adds a set-valued law to one with internal states; no engine integrates both."
        )


def dotted(laws: Collection[Law], passed: Collection[Collection[str]]) -> Iterator[str]:
    """Yield the full coefficient names of a law or a sum.

    Args:
        laws: the law, or the summands.
        passed: for each law the names of the coefficients that are passed.
    """
    for i, (law, names) in enumerate(zip(laws, passed, strict=True)):
        place = "friction" if len(laws) == 1 else f"friction.{i}"
        yield from (f"{place}.{name}" for name in law.present(names))


class Name(NamedTuple):
    """Shortest unique name and full name of a coefficient."""

    name: str
    dotted: str


def short_names(dotted: Sequence[str]) -> tuple[Name, ...]:
    """Shorten full names as far as they remain unique."""
    last = [name.rsplit(".", 1)[-1] for name in dotted]
    return tuple(
        Name(short if last.count(short) == 1 else full, full) for short, full in zip(last, dotted, strict=True)
    )
