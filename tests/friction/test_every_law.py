"""Every law moves, has derivatives, loses energy, and agrees with diffrax.

It can also be vectorised, stored, restored and found in the catalogue.
"""

import functools
import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.cli.models import describe
from fricjax.fitting import store
from fricjax.fitting.restored import restored
from fricjax.friction import AbstractFriction, Sum
from fricjax.oscillator import Oscillator, energy, is_successful, simulate
from tests.cases.case import LOAD
from tests.helpers import LAWS
from tests.tiers import cases

TS = np.linspace(0.0, 0.25, 501)
X0 = -2e-3
H = 1e-5
# One case of each law: variants of a law differ only in numbers, and each law is compiled separately.
MOVING = list(
    {type(case.law).__name__ + str(case.law.n_states): name for name, case in reversed(LAWS.items())}.values()
)

CORE = ("Coulomb", "LuGre")


def machine_with(law: AbstractFriction) -> Oscillator:
    return Oscillator(0.41068, 2574.0, 0.17557, LOAD, law)


@eqx.filter_jit
def look(law: AbstractFriction, along: AbstractFriction):
    """Return a motion, its energies, and its derivative in a direction."""

    def moved(law: AbstractFriction):
        machine = machine_with(law)
        motion = simulate(machine, X0, TS)
        return motion, energy(machine, motion)

    (motion, energies), (slope, _) = eqx.filter_jvp(moved, (law,), (along,))
    return motion, energies, slope.x


@functools.cache
def looked(name: str):
    law = jax.tree.map(jnp.asarray, LAWS[name].law)
    return look(law, law)


@pytest.mark.parametrize("name", cases(MOVING, CORE))
def test_it_moves(name: str):
    motion, _, _ = looked(name)
    assert bool(is_successful(motion.result))
    x = np.asarray(motion.x)
    assert x[0] == pytest.approx(X0)
    assert np.all(np.abs(x) <= abs(X0) * (1 + 1e-9))
    assert abs(x[-1]) < 0.99 * abs(X0)


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_its_motion_is_that_of_the_solvers_of_diffrax(name: str):
    machine = machine_with(LAWS[name].law)
    reference = simulate(machine, X0, TS, engine="diffrax")
    # The other tests use the same motion of the law's engine, so it is compiled once.
    motion = looked(name)[0] if name in MOVING else simulate(machine, X0, TS)
    np.testing.assert_allclose(reference.x, motion.x, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", cases(MOVING, CORE))
def test_its_derivative_along_all_coefficients_is_the_difference(name: str):
    law = jax.tree.map(jnp.asarray, LAWS[name].law)
    ends = [look(jax.tree.map(lambda c, s=s: c * (1 + s * H), law), law)[0].x for s in (1, -1)]
    expected = (np.asarray(ends[0]) - np.asarray(ends[1])) / (2 * H)
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(looked(name)[2], expected, atol=2e-3 * size)


@pytest.mark.parametrize("name", cases(MOVING, CORE))
def test_energy_is_only_lost(name: str):
    _, found, _ = looked(name)
    case = LAWS[name]
    total, load = np.asarray(found.total), jnp.asarray(LOAD)
    stored = case.static * float(jnp.sum(jnp.abs(case.law.pulled_state(jnp.sign(X0), load))))
    if case.passive:
        assert np.all(total <= total[0] + stored + 1e-12)
        assert total[-1] < 0.99 * total[0]
    lost = np.trapezoid(np.asarray(found.loss_power), TS)
    assert lost == pytest.approx(total[0] - total[-1], rel=3e-2)


@pytest.mark.parametrize("name", cases(LAWS, CORE))
def test_it_acts_on_many_speeds_at_once(name: str):
    law, load, speeds = LAWS[name].law, jnp.asarray(LOAD), jnp.asarray([-0.1, 1e-3, 0.2])

    def at(v):
        state = law.steady_state(jnp.abs(v), jnp.sign(v), load)
        return law.force(v, state, load), law.rate(v, state, load)

    together, apart = jax.vmap(at)(speeds), [at(v) for v in speeds]
    for several, each in zip(together, zip(*apart, strict=True), strict=True):
        np.testing.assert_allclose(several, jnp.stack(each), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", LAWS)
def test_it_is_stored_and_restored(name: str):
    law = LAWS[name].law
    back = restored(AbstractFriction, json.loads(json.dumps(store.plain_fields(law))), "law")
    assert jax.tree.structure(back) == jax.tree.structure(law)
    assert jax.tree.leaves(back) == jax.tree.leaves(law)


@pytest.mark.parametrize("name", LAWS)
def test_it_is_in_the_catalogue(name: str):
    law = LAWS[name].law
    for part in law.laws if isinstance(law, Sum) else (law,):
        entry = describe(type(part).__name__.lower(), type(part))
        assert [c["name"] for c in entry["coefficients"]] == list(part.coefficients)
        assert entry["about"] and entry["source"] and entry["identifies"]
