"""Losses without friction, from a run without contact."""

import pytest

from fricjax.energy_loss.force_map import friction_force_map
from fricjax.friction import Coulomb
from tests.energy_loss.runs import RIG, run


@pytest.mark.slow
def test_losses_come_from_a_run_without_contact():
    free = run(Coulomb(0.0), 2e-3, rate=2e3, duration=3.0)
    found = friction_force_map(run(Coulomb(0.05), 2e-3), RIG.replace(damping_ratio=None), free)
    assert found.damping == pytest.approx(float(RIG.oscillator(Coulomb(0.05)).damping), rel=1e-4)
    assert found.mu.value == pytest.approx(0.05, rel=1e-4)
