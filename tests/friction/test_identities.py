"""Laws with internal states against equivalent laws and closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import BlimanSorine, BoucWen, Dahl, ElastoPlastic, LuGre
from fricjax.oscillator import Oscillator, simulate
from tests.friction.machines import ROLLING, TENTH_OF_A_NANOMETRE, X0, motion

LOAD = jnp.asarray(ROLLING.normal_force)
MU, SIGMA0 = 0.01, 1e5
LENGTH = MU * ROLLING.normal_force / SIGMA0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "coefficients"),
    [
        ("BoucWen", {"mu": MU, "sigma0": SIGMA0, "n": 1.0, "beta": 1.0}),
        ("BlimanSorine", {"mu1": MU, "mu2": 0.0, "eta": 0.5, "epsilon": 2 * LENGTH}),
        ("Rolling", {"mu": MU, "length": LENGTH}),
        ("LuGre", {"mu": MU, "mu_s": MU, "v_stribeck": 1e-3, "sigma0": SIGMA0, "sigma1": 0.0, "sigma2": 0.0}),
    ],
)
def test_dahl_in_other_words(name: str, coefficients: dict[str, float]):
    expected = motion("Dahl", {"mu": MU, "sigma0": SIGMA0}).x
    np.testing.assert_allclose(motion(name, coefficients).x, expected, rtol=0, atol=1e-8 * X0)


@pytest.mark.slow
def test_half_cycles_of_dahl():
    # Each reversal returns 2 F_d l: a' = -x_d + sqrt((a - x_d)^2 + 4 x_d l), for strokes far longer than l.
    machine = Oscillator(ROLLING.mass, ROLLING.stiffness, 0.0, ROLLING.normal_force, Dahl(MU, SIGMA0))
    found = simulate(machine, X0, np.linspace(0, 0.3, 3001))
    band = float(machine.dead_band)
    points = np.abs(np.asarray(found.turning_points))[: int(found.n_half_cycles)]
    expected = [X0]
    for _ in points:
        expected.append(-band + np.sqrt((expected[-1] - band) ** 2 + 4 * band * LENGTH))
    np.testing.assert_allclose(points[1:], expected[1 : points.size], rtol=0, atol=TENTH_OF_A_NANOMETRE)


def strain(law, travel: np.ndarray, start: jax.Array, direction: float) -> np.ndarray:
    """Force along a path in one direction, by RK4 in small steps."""
    sign = jnp.asarray(direction)

    def step(state, h):
        k1 = law.rate(sign, state, LOAD)
        k2 = law.rate(sign, state + h / 2 * k1, LOAD)
        k3 = law.rate(sign, state + h / 2 * k2, LOAD)
        k4 = law.rate(sign, state + h * k3, LOAD)
        after = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return after, law.force(0.0 * sign, after, LOAD)

    return np.asarray(jax.lax.scan(step, start, jnp.diff(jnp.asarray(travel)))[1])


def test_virgin_curve_and_peak_of_bliman_and_sorine():
    law = BlimanSorine(0.015, 0.005, 0.3, 1e-6)
    f1, f2, eta, epsilon = 0.015 * 1.89, 0.005 * 1.89, 0.3, 1e-6
    travel = np.linspace(0, 8e-6, 4001)
    found = strain(law, travel, jnp.zeros(2), 1.0)
    expected = f1 * -np.expm1(-travel / (eta * epsilon)) - f2 * -np.expm1(-travel / epsilon)
    np.testing.assert_allclose(found, expected[1:], rtol=1e-9)
    peak = eta * epsilon / (1 - eta) * np.log(f1 / (eta * f2))
    assert float(law.peak_travel()) == pytest.approx(peak, rel=1e-12)
    assert abs(travel[1 + np.argmax(found)] - peak) < 3e-9
    assert float(law.static_force(LOAD)) == pytest.approx(np.max(found), rel=1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_strain_of_dahl(exponent: float, direction: float):
    # w = 1 - F/F_c falls from 1 as dw/ds = -w^i/l.
    travel = np.linspace(0, 6 * LENGTH, 2001)
    found = strain(Dahl(MU, SIGMA0, exponent), travel, jnp.zeros(1), direction)
    u, i = travel[1:] / LENGTH, exponent
    w = np.exp(-u) if i == 1 else (1 + (i - 1) * u) ** (-1 / (i - 1))
    np.testing.assert_allclose(found, direction * MU * 1.89 * (1 - w), rtol=1e-9)


def test_return_of_bouc_and_wen():
    # Behind a reversal, until the force vanishes: dzeta/ds = -(1 + (2 beta - 1) zeta)/l for n = 1.
    beta, travel = 0.75, np.linspace(0, 0.6 * LENGTH, 1001)
    found = strain(BoucWen(MU, SIGMA0, 1.0, beta), travel, jnp.asarray([LENGTH]), -1.0)
    c = 2 * beta - 1
    zeta = (1 + 1 / c) * np.exp(-c * travel[1:] / LENGTH) - 1 / c
    np.testing.assert_allclose(found, MU * 1.89 * zeta, rtol=1e-9)
    straight = strain(BoucWen(MU, SIGMA0, 3.0, 0.5), travel, jnp.asarray([LENGTH]), -1.0)
    np.testing.assert_allclose(straight, MU * 1.89 - SIGMA0 * travel[1:], rtol=1e-9)


@pytest.mark.parametrize("law", [LuGre(MU, 0.013, 5e-3, sigma2=0.4), ElastoPlastic(MU, 0.013, 5e-3, sigma2=0.4)])
def test_steady_sliding_of_a_brush_is_the_stribeck_curve(law):
    for v in (1e-4, 4e-3, -2e-2):
        state = law.steady_state(jnp.asarray(v), jnp.sign(v), LOAD)
        expected = np.sign(v) * 1.89 * (MU + 0.003 * np.exp(-((v / 5e-3) ** 2))) + 0.4 * v
        assert float(law.force(jnp.asarray(v), state, LOAD)) == pytest.approx(expected, rel=1e-12)
