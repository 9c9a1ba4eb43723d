"""Records that end in the last stroke, from which friction lets the mass go by little."""

import numpy as np
import pytest

from fricjax import Oscillator, fit, fit_batch, synthetic_run
from fricjax.friction import Stribeck, Tanh
from tests.fitting.runs import STIFFNESS
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

TRUTH = {"mu": 0.02, "mu_s": 0.026, "v_stribeck": 5e-3, "stiffness": STIFFNESS}


def machine(v_stribeck: float) -> Oscillator:
    law = Stribeck(TRUTH["mu"], TRUTH["mu_s"], v_stribeck)
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, law)


@pytest.mark.slow
@pytest.mark.parametrize("duration", [0.44, 0.455, 0.48])
def test_the_last_stroke_needs_no_stop(duration: float):
    """It begins at 0.437 s, at 1.55 times the static dead band, and the mass comes to rest at 0.477 s."""
    run = synthetic_run(machine(TRUTH["v_stribeck"]), 1.9e-3, rate=2500.0, duration=duration, noise=5e-9, seed=1)
    found = fit(run, machine(4e-3), list(TRUTH))
    assert found.converged and 0.8 < found.chi2_reduced < 1.2
    assert found.numerical_shift < 0.1
    for name, true in TRUTH.items():
        assert abs(found.values[name] - true) < 4 * found.std_errors[name], name


@pytest.mark.slow
@pytest.mark.parametrize("v_s", [1e-3, 1e-4])
def test_a_law_that_creeps_is_fitted_wherever_its_record_ends(v_s: float):
    """Slow strokes swing on within the dead band at 1e-3 m/s; at 1e-4 m/s the last creep may look like a reversal."""
    random = np.random.default_rng(2)
    mu, starts = random.uniform(0.005, 0.02, 24), random.uniform(0.5e-3, 3e-3, 24)

    def of(coefficient: float) -> Oscillator:
        return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 1.89, Tanh(coefficient, v_s))

    how = {"rate": 5e3, "duration": 2.0, "noise": 5e-9}
    runs = [synthetic_run(of(m), x0, seed=i, **how) for i, (m, x0) in enumerate(zip(mu, starts, strict=True))]
    found = fit_batch(runs, of(0.01), ["mu", "damping", "stiffness"])
    assert found.status == ("converged",) * 24
    assert np.all(np.abs(found.values["mu"] - mu) < 4 * found.std_errors["mu"])
