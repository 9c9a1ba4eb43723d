"""Uncertain inputs of a rig, against fits with a changed input."""

from typing import Any

import numpy as np
import pytest

from fricjax import Measured, Oscillator, Rig, fit, synthetic_run
from fricjax.errors import UsageError
from fricjax.friction import Coulomb
from fricjax.oscillator.restoring import Pendulum
from tests.helpers import PROTOTYPE_MASS
from tests.machines import FREQUENCY, coulomb_run

FREE = ("mu", "damping")
INPUTS: dict[str, Any] = {
    "mass": Measured(PROTOTYPE_MASS, 2e-3 * PROTOTYPE_MASS),
    "frequency": Measured(FREQUENCY, 1e-7 * FREQUENCY),
    "normal_force": Measured(9.66, 5e-3 * 9.66),
}


def fitted(**inputs):
    rig = Rig(**inputs)
    return fit(coulomb_run(), rig.oscillator(Coulomb(0.05)), FREE, rig=rig)


@pytest.fixture(scope="module")
def found():
    return fitted(**INPUTS)


def test_half_a_percent_of_the_load_shows_in_mu(found):
    relative = found.combined_std_errors["mu"] / found.values["mu"]
    assert relative >= 5e-3
    # mu = omega^2 x_d m/N: load and mass add in quadrature; frequency and noise are negligible.
    assert relative == pytest.approx(np.hypot(5e-3, 2e-3), rel=1e-3)
    assert found.std_errors["mu"] / found.values["mu"] < 1e-5


def test_the_damping_scales_with_the_mass(found):
    relative = found.combined_std_errors["damping"] / found.values["damping"]
    assert relative == pytest.approx(2e-3, rel=0.05)


def test_first_order_propagation_agrees_with_refits(found):
    """Move each input by a part of its uncertainty, both ways.

    The shift of the optimum must agree with the covariance.
    """
    share = 0.3
    moved = []
    for name, value in INPUTS.items():
        ends = [fitted(**{**INPUTS, name: Measured(value.value + s * share * value.std, value.std)}) for s in (1, -1)]
        names = found.names
        moved.append([(ends[0].values[n] - ends[1].values[n]) / (2 * share) for n in names])
    expected = found.covariance + np.array(moved).T @ np.array(moved)
    scale = np.sqrt(np.diag(expected))
    assert found.combined_covariance / np.outer(scale, scale) == pytest.approx(
        expected / np.outer(scale, scale), abs=2e-3
    )


def test_an_input_that_is_fitted_adds_nothing():
    rig = Rig(**{**INPUTS, "damping": Measured(0.18, 0.05)})
    exact = Rig(**{**INPUTS, "damping": Measured(0.18)})
    with_it = fit(coulomb_run(), rig.oscillator(Coulomb(0.05)), FREE, rig=rig)
    without = fit(coulomb_run(), exact.oscillator(Coulomb(0.05)), FREE, rig=exact)
    assert with_it.combined_std_errors["mu"] == pytest.approx(without.combined_std_errors["mu"], rel=1e-6)


def test_the_report_shows_the_combined_uncertainty(found):
    assert "Value (combined uncertainty)" in found.summary()
    assert "0.05000(27)" in found.summary()


def test_a_rig_of_another_machine_is_refused():
    rig = Rig(**INPUTS, restoring=Pendulum())
    machine = Rig(**INPUTS).oscillator(Coulomb(0.05))
    with pytest.raises(UsageError, match=r"The rig describes another machine than the oscillator\. Build it with rig"):
        fit(coulomb_run(), machine, FREE, rig=rig)


def test_a_rig_with_other_numbers_is_refused():
    machine = Rig(**INPUTS).oscillator(Coulomb(0.05))
    other = Rig(**{**INPUTS, "normal_force": Measured(5.0, 0.1)})
    with pytest.raises(
        UsageError, match=r"The rig gives normal_force = 5, but the oscillator has 9\.66\. Build it with rig"
    ):
        fit(coulomb_run(), machine, FREE, rig=other)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
def test_a_rig_changes_neither_the_noise_nor_the_standard_errors(seed):
    """Compare fits with and without a rig under a periodic error.

    Free parameters absorb the effect of the mass, so its derivative must not change the noise model by rounding.
    """
    truth = Oscillator(0.41068, 2574.0, 0.1756, 9.66, Coulomb(0.05, mu_s=0.065))
    record = synthetic_run(
        truth, 2e-3, rate=2e4, duration=0.3, hold=0.02, noise=1e-9, periodic_nonlinearity=(2e-9, 0.7e-9), seed=seed
    )
    rig = Rig(mass=Measured(0.41068, 4e-5), stiffness=Measured(2574.0, 2.0), normal_force=Measured(9.66, 0.0483))
    alone, calibrated = (fit(record, truth, ["mu", "damping", "stiffness"], rig=each) for each in (None, rig))
    for name in alone.names:
        assert calibrated.std_errors[name] == pytest.approx(alone.std_errors[name], rel=1e-6)
    assert calibrated.noises[0].memory == pytest.approx(alone.noises[0].memory, rel=1e-6)
    assert abs(calibrated.values["mu"] - 0.05) < 4 * calibrated.std_errors["mu"]
