"""Names that belong to an oscillator, known without building one: its coefficients and its engines."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from ..friction.catalogue import Law, dotted

ENGINES = ("auto", "exact", "hybrid", "smooth", "diffrax")


class Name(NamedTuple):
    """A coefficient by name: the shortest one that tells it from the others, and the whole one."""

    name: str
    dotted: str


def named(dotted: Sequence[str]) -> tuple[Name, ...]:
    """The shortest names for these whole ones."""
    last = [name.rsplit(".", 1)[-1] for name in dotted]
    return tuple(
        Name(short if last.count(short) == 1 else full, full) for short, full in zip(last, dotted, strict=True)
    )


def coefficient_names(
    laws: Collection[Law], named_coefficients: Collection[Collection[str]], spring: Collection[str]
) -> tuple[Name, ...]:
    """The coefficients of an oscillator in the order of its leaves.

    Args:
        laws: its law, or the summands of it.
        named_coefficients: for each of them the names of the coefficients that are given.
        spring: names of the coefficients of its restoring force besides the stiffness.
    """
    machine = ("mass", "stiffness", "damping", "normal_force")
    return named([*machine, *dotted(laws, named_coefficients), *(f"restoring.{name}" for name in spring), "drag"])


def check_engine(name: str) -> None:
    """Refuse a name that no engine has.

    Raises:
        ValueError: names those that there are.
    """
    if name not in ENGINES:
        raise ValueError(f"There is no engine {name!r}. Choose one of {', '.join(ENGINES)}.")
