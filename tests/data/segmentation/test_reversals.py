"""Reversals and their friction forces scatter by their standard errors."""

import numpy as np
import pytest

import fricjax as fj
from fricjax import half_cycle_friction
from fricjax.data.segmentation.reversals import order_for, point_std, refine, window
from tests.oracles import coulomb_viscous

RATE, FREQUENCY, BAND = 10e3, 12.6, 1.876e-4
T = np.arange(round(0.5 * RATE)) / RATE


@pytest.mark.parametrize("noise", [1e-9, 5e-6])
def test_the_position_of_a_turn_scatters_by_its_standard_error(noise):
    """Half-cycles far above the noise need fourth powers of time."""
    decay = coulomb_viscous(T, 2e-3, frequency=FREQUENCY, zeta=0.0027, dead_band=BAND)
    turns, points, half = decay.stops[:3], decay.points[:3], decay.half_period
    sizes = np.abs(np.diff(np.concatenate([[2e-3], decay.points[:4]])))
    order = order_for(np.minimum(sizes[:-1], sizes[1:]), noise)
    width = window(np.full(3, half), np.maximum(sizes[:-1], sizes[1:]) / 2, noise, 1 / RATE)
    found = np.array(
        [
            refine(
                T,
                decay.x + noise * np.random.default_rng(i).standard_normal(T.size),
                turns,
                np.pi / half,
                [(width, order)],
            )[1]
            for i in range(300)
        ]
    )
    expected = point_std(width, order, noise, 1 / RATE)
    assert set(order) == ({4} if noise < 1e-7 else {2})
    assert np.std(found - points, axis=0) == pytest.approx(expected, rel=0.13)


@pytest.mark.slow
def test_the_forces_of_half_cycles_scatter_by_their_standard_errors():
    """With the mean of its rest, a stop outweighs a reversal."""
    mass, stiffness, load, mu = 0.41068, 2574.0, 9.66, 0.05
    damping = 2 * 0.0027 * np.sqrt(mass * stiffness)
    rig = fj.Rig(mass=mass, stiffness=stiffness, damping=damping, normal_force=load)
    machine = rig.oscillator(fj.friction.Coulomb(mu))
    scores, chi2 = [], []
    for seed in range(60):
        x0 = np.random.default_rng(seed).uniform(1.2e-3, 2e-3)
        found = half_cycle_friction(fj.synthetic_run(machine, x0, rate=5e3, duration=0.4, noise=1e-8, seed=seed), rig)
        scores.append((found.mean.value - mu * load) / found.mean.std)
        chi2.append(found.chi2_reduced)
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.25)
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.3)
