"""The coefficient from a dead band: both ways agree on one machine, and their uncertainties are the known budgets."""

import math

import numpy as np
import pytest

from fricjax.calibrate import Measured
from fricjax.calibrate.coefficient import mu_by_mass_ratio, mu_by_stiffness
from fricjax.calibrate.propagate import propagated
from fricjax.data.errors import UsageError
from fricjax.fitting.settled import Estimate

MU, MASS, STIFFNESS, LOAD_MASS, GRAVITY = 0.05, 0.41068, 2574.0, 0.985, 9.81
LOAD = LOAD_MASS * GRAVITY
DEAD_BAND = MU * LOAD / STIFFNESS
FREQUENCY = math.sqrt(STIFFNESS / MASS) / (2 * math.pi)


def test_both_ways_give_the_coefficient_that_made_the_dead_band():
    assert mu_by_stiffness(DEAD_BAND, STIFFNESS, LOAD).value == pytest.approx(MU, rel=1e-14)
    assert mu_by_mass_ratio(DEAD_BAND, FREQUENCY, MASS, LOAD_MASS, GRAVITY).value == pytest.approx(MU, rel=1e-13)


def test_buoyancy_carries_a_part_of_the_weight():
    in_air = mu_by_mass_ratio(DEAD_BAND, FREQUENCY, MASS, LOAD_MASS, GRAVITY, air_density=1.2, load_density=8000.0)
    assert in_air.value == pytest.approx(MU / (1 - 1.5e-4), rel=1e-12)


def test_uncertainty_of_the_stiffness_way_is_the_root_of_the_sum_of_squares():
    found = mu_by_stiffness(
        Estimate(DEAD_BAND, 6e-5 * DEAD_BAND, "m"), Measured(STIFFNESS, 0.01 * STIFFNESS), Measured(LOAD, 0.005 * LOAD)
    )
    assert found.relative == pytest.approx(math.hypot(0.01, 0.005, 6e-5), rel=1e-3)


def test_uncertainty_of_the_mass_ratio_is_that_of_repeated_measurements():
    stated = [(DEAD_BAND, 1e-6), (FREQUENCY, 3e-5), (MASS, 2e-4), (LOAD_MASS, 2e-5), (GRAVITY, 1e-5)]
    inputs = [Measured(value, value * relative) for value, relative in stated]
    air, steel = Measured(1.2, 0.05), Measured(7900.0, 50.0)
    generator = np.random.default_rng(1)
    drawn = [number.value + number.std * generator.standard_normal(200_000) for number in (*inputs, air, steel)]
    x_d, f, m, m_w, g, rho_a, rho_w = drawn
    repeated = (2 * np.pi * f) ** 2 * x_d * m / (m_w * g * (1 - rho_a / rho_w))
    found = mu_by_mass_ratio(*inputs, air_density=air, load_density=steel)
    assert found.std == pytest.approx(np.std(repeated), rel=0.01)
    assert found.value == pytest.approx(np.mean(repeated), rel=1e-5)


def test_a_dead_band_of_zero_keeps_its_uncertainty():
    found = mu_by_stiffness(Measured(0.0, 1e-9), STIFFNESS, LOAD)
    assert (found.value, found.std) == (0.0, pytest.approx(1e-9 * STIFFNESS / LOAD))


def test_first_order_of_a_product_and_a_sum():
    a, b = Measured(3.0, 0.01), Measured(4.0, 0.02)
    assert propagated(lambda x, y: x * y, a, b).std == pytest.approx(math.hypot(4 * 0.01, 3 * 0.02), rel=1e-12)
    assert propagated(lambda x, y: x - y, a, b).std == pytest.approx(math.hypot(0.01, 0.02), rel=1e-12)


def test_refusals_by_their_text():
    with pytest.raises(UsageError, match=r"normal_force must be a positive number of N, got 0."):
        mu_by_stiffness(DEAD_BAND, STIFFNESS, 0.0)
    with pytest.raises(UsageError, match="dead_band must be a number in SI units or a Measured, got 'wide'"):
        mu_by_stiffness("wide", STIFFNESS, LOAD)
    with pytest.raises(UsageError, match=r"air_density must lie between zero and the load_density of 1 kg/m\^3, got 2"):
        mu_by_mass_ratio(DEAD_BAND, FREQUENCY, MASS, LOAD_MASS, GRAVITY, air_density=2.0, load_density=1.0)
