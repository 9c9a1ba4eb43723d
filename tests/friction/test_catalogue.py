"""The table of laws, which works without JAX, against the classes."""

import dataclasses
from typing import Any, get_origin

import jax
import pytest

from fricjax import friction
from fricjax.friction import Coulomb, Sum
from fricjax.friction.catalogue import CATALOGUE
from fricjax.friction.stribeck_curve import AbstractFalling
from fricjax.machine.laws import coefficient_names
from fricjax.oscillator import Oscillator
from fricjax.oscillator.oscillator import leaves_of
from fricjax.oscillator.restoring import Cubic, Linear
from tests.helpers import EXPORTED_LAWS, LAWS

CLASSES = {name.lower(): law for name, law in EXPORTED_LAWS.items() if name != "Sum"}


def kind(law: Any) -> str:
    """Return the kind of a law as an engine distinguishes it.

    A list law has as many states as elements, and at least one.
    """
    if law.n_states != 0:
        return "bristle"
    return "set-valued" if law.set_valued else "smooth"


def test_all_laws_are_there_and_no_others():
    assert list(CATALOGUE) == list(CLASSES)
    assert [law.name for law in CATALOGUE.values()] == [law.__name__ for law in CLASSES.values()]


@pytest.mark.parametrize("name", CLASSES)
def test_a_law_has_the_coefficients_of_its_class(name):
    told, fields = CATALOGUE[name], dataclasses.fields(CLASSES[name])
    assert told.coefficients == tuple(field.name for field in fields)
    assert told.needed == tuple(field.name for field in fields if field.default is dataclasses.MISSING)
    assert told.optional == tuple(field.name for field in fields if field.default is None)
    assert told.lists == any(get_origin(field.type) is tuple for field in fields)
    assert told.falls == issubclass(CLASSES[name], AbstractFalling)
    assert told.kind == kind(CLASSES[name])


def parts_of(name: str) -> tuple[Any, ...]:
    law: Any = LAWS[name].law
    return law.laws if isinstance(law, Sum) else (law,)


def entries(name: str) -> list[Any]:
    """Entries of a law, or of the terms of a sum.

    The list is empty for laws that the command line cannot name.
    """
    found = [CATALOGUE.get(type(part).__name__.lower()) for part in parts_of(name)]
    return found if all(entry is not None and not entry.lists for entry in found) else []


@pytest.mark.parametrize("spring", [Linear(), Cubic(1e6)])
@pytest.mark.parametrize("name", [name for name in LAWS if entries(name)])
def test_names_of_coefficients_are_those_of_the_oscillator(name, spring):
    """Compare names from the given coefficients with the leaves of the oscillator."""
    given = [
        [field.name for field in dataclasses.fields(part) if getattr(part, field.name) is not None]
        for part in parts_of(name)
    ]
    machine = Oscillator(0.41, 2574.0, 0.1, 9.66, LAWS[name].law, restoring=spring)
    names = coefficient_names(entries(name), given, ("k3",) if isinstance(spring, Cubic) else ())
    assert [(one.name, one.dotted) for one in leaves_of(machine)] == [tuple(one) for one in names]
    assert len(names) == len(jax.tree.leaves(machine))


def test_a_sum_that_no_engine_integrates_is_refused_in_the_same_words():
    from fricjax.machine.laws import summands

    with pytest.raises(ValueError) as by_classes:
        Sum((Coulomb(0.1), friction.LuGre(0.1)))
    with pytest.raises(ValueError) as by_names:
        summands("coulomb+lugre")
    assert str(by_classes.value) == str(by_names.value)
