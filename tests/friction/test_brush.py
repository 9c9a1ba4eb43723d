"""LuGre and elasto-plastic brushes: slip, passivity and rest."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import ElastoPlastic, LuGre
from fricjax.oscillator import Oscillator, simulate
from tests.friction.machines import SLIDING, TENTH_OF_A_NANOMETRE, TS

LOAD = jnp.asarray(2.0)
PLASTIC = ElastoPlastic(0.1, None, 5e-3, sigma0=1e4, sigma1=0.0, breakaway_fraction=0.3)
Z_SS = 0.1 * 2.0 / 1e4


def share(law: ElastoPlastic, v: float, z: float) -> float:
    return float(law.slipping(jnp.asarray(v), jnp.asarray([z]), LOAD)[0])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_share_of_slipping_bristles(side: float):
    # 1/2 + 1/2 sin(pi (0.75 - 0.65)/0.7) = 0.7169; the form without |z| gives 0.50 on the negative side.
    assert share(PLASTIC, side * 0.01, side * 0.75 * Z_SS) == pytest.approx(0.5 + 0.5 * np.sin(np.pi / 7), rel=1e-12)
    assert share(PLASTIC, side * 0.01, side * 0.29 * Z_SS) == 0.0
    assert share(PLASTIC, side * 0.01, side * 1.01 * Z_SS) == 1.0
    assert share(PLASTIC, -side * 0.01, side * 0.75 * Z_SS) == 0.0


@pytest.mark.slow
def test_an_elastic_contact_rings_for_ever_without_drift():
    # Below breakaway the contact is a spring: about a rest position under load the mass swings at sqrt((k + sigma0)/m).
    law = ElastoPlastic(0.05, 0.065, 5e-3, sigma0=1e5, sigma1=0.0, breakaway_fraction=0.5)
    machine = Oscillator(SLIDING.mass, SLIDING.stiffness, 0.0, SLIDING.normal_force, law)
    z_ss, swing = 0.05 * SLIDING.normal_force / 1e5, 2e-7
    bend = 0.3 * z_ss
    rest = -1e5 * bend / SLIDING.stiffness
    found = simulate(machine, rest + swing, TS, state0=np.array([bend + swing]))
    expected = rest + swing * np.cos(np.sqrt((SLIDING.stiffness + 1e5) / SLIDING.mass) * TS)
    np.testing.assert_allclose(found.x, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)
    v, state = jnp.asarray(1e-6), jnp.asarray([bend])
    load = jnp.asarray(SLIDING.normal_force)
    assert float(law.rate(v, state, load)[0]) == 1e-6
    assert float(LuGre(0.05, sigma0=1e5).rate(v, state, load)[0]) == pytest.approx(0.7e-6)


def test_fading_damping():
    v, state = jnp.asarray(0.02), jnp.asarray([0.4 * Z_SS])
    plain, fading = (LuGre(0.1, sigma0=1e4, sigma1=50.0, v_damping=fade) for fade in (None, 0.01))
    damped = 50.0 * 0.02 * (1 - 0.4)
    assert float(plain.force(v, state, LOAD)) == pytest.approx(0.4 * 0.2 + damped, rel=1e-12)
    assert float(fading.force(v, state, LOAD)) == pytest.approx(0.4 * 0.2 + damped * np.exp(-4), rel=1e-12)


def jump(law: LuGre | ElastoPlastic, v: float, load: float) -> float:
    """Force after a jump from slow sliding to `v`."""
    slow = law.steady_state(jnp.asarray(1e-9), jnp.asarray(1.0), jnp.asarray(load))
    return float(law.force(jnp.asarray(v), slow, jnp.asarray(load)))


@pytest.mark.parametrize("kind", [LuGre, ElastoPlastic])
def test_the_coefficients_of_1995_are_not_passive(kind: type):
    law = kind(1.0, 1.5, 1e-3, sigma0=1e5, sigma1=316.2, sigma2=0.4)
    assert not law.passive(1.0)
    assert jump(law, 0.1, 1.0) < 0
    (remark,) = law.warnings(1.0)
    assert remark == (
        f"With these coefficients {kind.__name__} can give back more work than it took in: sigma2 = 0.4 N s/m is below "
        "sigma1 (mu_s - mu)/mu = 158.1 N s/m. Raise sigma2, lower sigma1, or let sigma1 fade with speed by v_damping."
    )


@pytest.mark.parametrize(("sigma2", "passive"), [(49.9, False), (50.1, True)])
def test_constant_damping_is_passive_from_the_bound_of_barabanov_and_ortega(sigma2: float, passive: bool):
    law = LuGre(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=100.0, sigma2=sigma2)
    assert law.passive(2.0) is passive
    assert (jump(law, 1e3, 2.0) > 0) is passive
    assert bool(law.warnings(2.0)) is not passive


@pytest.mark.parametrize(("times", "passive"), [(0.99, True), (20.0, False)])
def test_fading_damping_is_passive_where_it_fades_soon(times: float, passive: bool):
    # A sufficient condition is sigma1 v_damping <= 4 sqrt(2 e) mu N.
    sigma1 = times * 4 * np.sqrt(2 * np.e) * 0.2 / 0.05
    law = LuGre(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=sigma1, v_damping=0.05)
    assert law.passive(2.0) is passive
    # Absorbed power minus the growth of the energy sigma0 z^2/2, for all deflections that slow sliding can reach.
    v, bend = (grid.ravel() for grid in np.meshgrid(np.geomspace(1e-4, 10, 200), np.linspace(-3e-5, 3e-5, 101)))
    force = jax.vmap(lambda v, z: law.force(v, z, LOAD))(jnp.asarray(v), jnp.asarray(bend)[:, None])
    rate = jax.vmap(lambda v, z: law.rate(v, z, LOAD))(jnp.asarray(v), jnp.asarray(bend)[:, None])[:, 0]
    assert bool(np.all(force * v - 1e4 * bend * rate >= -1e-12)) is passive
    assert [("fades too slowly" in remark) for remark in law.warnings(2.0)] == [True] * (not passive)


def test_negative_viscous_friction_is_not_passive():
    law = LuGre(0.1, sigma2=-0.5)
    assert not law.passive(2.0)
    assert "sigma2 = -0.5 N s/m is negative" in law.warnings(2.0)[0]


def test_a_sum_tells_the_remarks_of_its_laws():
    law = LuGre(0.1, sigma2=-0.5) + LuGre(0.1) + LuGre(0.1, sigma2=-0.2)
    assert len(law.warnings(2.0)) == 2
