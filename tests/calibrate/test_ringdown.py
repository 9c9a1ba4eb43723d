"""Ring-down calibration recovers the rig from a simulated run without contact."""

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fricjax as fj
from fricjax.calibrate.ringdown import _best, calibrate_ringdown
from fricjax.calibrate.ringdown_calibration import Term
from fricjax.errors import UsageError
from fricjax.oscillator.restoring import Cubic
from fricjax.rig import Measured
from tests.helpers import PROTOTYPE_DAMPING as DAMPING
from tests.helpers import PROTOTYPE_MASS as MASS

STIFFNESS, FREQUENCY, RATIO, LOAD = 2574.0, 12.6, 0.0027, 1.89


def run(mu=0.0, *, duration=20.0, noise=1e-9, **machine):
    oscillator = fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, fj.friction.Coulomb(mu), **machine)
    return fj.synthetic_run(oscillator, 2e-3, rate=1e4, duration=duration, noise=noise, seed=1)


@pytest.fixture(scope="module")
def viscous():
    """Calibrate the prototype without contact.

    The test of the command line also searches for quadratic drag.
    """
    return calibrate_ringdown(run(), drag=False)


@pytest.fixture(scope="module")
def cubic():
    """A rig with quadratic drag and a spring that stiffens."""
    return calibrate_ringdown(run(restoring=Cubic(4e6), drag=7e-3), restoring="cubic", friction=False)


def test_a_nanometre_gives_frequency_and_damping(viscous):
    assert viscous.frequency.value == pytest.approx(FREQUENCY, rel=1e-8)
    assert viscous.damping_ratio.value == pytest.approx(RATIO, rel=1e-5)
    assert abs(viscous.frequency.value - FREQUENCY) < 4 * viscous.frequency.std < 1e-8 * FREQUENCY
    assert abs(viscous.damping_ratio.value - RATIO) < 4 * viscous.damping_ratio.std < 1e-5 * RATIO
    assert viscous.warnings == ()


def test_a_term_that_is_not_there_is_said_to_be_insignificant(viscous):
    assert [term.kept for term in viscous.terms] == [False]
    assert abs(viscous.dead_band.value) < 3 * viscous.dead_band.std < 1e-12
    assert (viscous.quadratic_drag, viscous.cubic) == (None, None)
    assert len(viscous.notes) == 1
    assert viscous.notes[0].startswith("The dead band is not significant, ")
    assert viscous.notes[0].endswith(" standard uncertainties from zero; it was left out.")
    assert viscous.aicc["damping"] == 0 < viscous.aicc["damping + dead band"]


@pytest.mark.slow
def test_quadratic_drag_and_cubic_spring_are_found(cubic):
    for number, true in ((cubic.quadratic_drag, 7e-3 / MASS), (cubic.cubic, 4e6 / MASS), (cubic.frequency, FREQUENCY)):
        assert abs(number.value - true) < 4 * number.std < 1e-4 * true
    assert cubic.damping_ratio.value == pytest.approx(RATIO, rel=1e-5)
    assert cubic.dead_band is None
    assert cubic.notes == ()


@pytest.mark.slow
def test_equivalent_damping_is_the_decrement_of_a_run(viscous):
    mu, drag = 1e-4, 7e-2
    band, per_mass = Measured(mu * LOAD / STIFFNESS), Measured(drag / MASS)
    terms = (Term("mu", band, True), Term("drag", per_mass, True))
    found = fj.data.segment_record(run(mu, drag=drag, duration=2.0))
    swings = np.abs(np.diff(found.turning_points))  # free of the offset
    decrement = np.log(swings[:-1] / swings[1:]) / math.pi
    amplitude = (swings[:-1] + swings[1:]) / 4
    equivalent = dataclasses.replace(viscous, terms=terms).damping_ratio_at(amplitude)
    np.testing.assert_allclose(equivalent, decrement, rtol=2e-4)
    assert np.all(equivalent > 1.02 * RATIO)


@pytest.mark.slow
def test_rig_of_a_ringdown_scales_with_the_mass(cubic):
    rig = cubic.rig(Measured(MASS, 1e-4 * MASS), normal_force=LOAD)
    assert rig.k3 is not None
    assert rig.k3.value == pytest.approx(4e6, rel=1e-5)
    assert rig.k3.relative == pytest.approx(1e-4, rel=1e-2)
    assert rig.drag.value == pytest.approx(7e-3, rel=1e-4)
    assert (rig.frequency, rig.damping_ratio) == (cubic.frequency, cubic.damping_ratio)
    assert float(rig.oscillator(fj.friction.Coulomb(0.01)).stiffness) == pytest.approx(STIFFNESS, rel=1e-7)


def test_a_rig_takes_no_term_that_was_left_out(viscous):
    rig = viscous.rig(MASS, normal_force=LOAD)
    assert (rig.drag, rig.k3) == (Measured(0.0), None)


def test_friction_of_the_guides_is_a_dead_band():
    found = calibrate_ringdown(run(mu=1e-5), drag=False)
    band = 1e-5 * LOAD / STIFFNESS
    assert found.dead_band is not None
    assert abs(found.dead_band.value - band) < 4 * found.dead_band.std < 1e-4 * band
    assert found.damping_ratio.value == pytest.approx(RATIO, rel=1e-5)
    assert found.notes == ()


def test_summary_and_plain_data(viscous):
    text = viscous.summary()
    assert "natural frequency  12.6000000" in text
    assert "left out\n" in text
    assert viscous.notes[0] in text
    assert "<table>" in viscous._repr_html_()
    told = viscous.to_dict()
    assert told["frequency"] == {"value": viscous.frequency.value, "std": viscous.frequency.std}
    assert told["kept"] == []


def test_a_term_of_the_wrong_sign_is_told():
    assert Term("drag", Measured(-1.0, 0.1), True).note() == (
        "The quadratic drag is negative by 10 standard uncertainties, impossible for a passive rig: the model is "
        "incomplete. It was kept."
    )
    assert Term("k3", Measured(-1.0, 0.1), True).note() == ""
    assert Term("mu", Measured(1.0, 0.5), True).note() == (
        "The dead band is not significant, 2 standard uncertainties from zero; it was kept."
    )


def stub(aicc, **terms):
    """Stand-in for a fit, with all standard errors equal to one."""
    return SimpleNamespace(values=terms, std_errors=dict.fromkeys(terms, 1.0), optimum_found=True, aicc=aicc)


def test_a_fit_in_which_a_term_feeds_the_motion_is_not_chosen():
    fits: Any = {(): stub(100.0), ("mu", "drag"): stub(0.0, mu=5.0, drag=-5.0), ("mu",): stub(10.0, mu=5.0)}
    assert _best(fits) == ("mu",)
    fits["mu", "drag"].values["drag"] = -2.0
    assert _best(fits) == ("mu", "drag")
    softening: Any = {(): stub(1.0), ("k3",): stub(0.0, k3=-9.0)}
    assert _best(softening) == ("k3",)


def test_an_unknown_restoring_force_offers_the_nearest():
    with pytest.raises(UsageError, match=r"There is no restoring force 'cubik'; known are .* Did you mean 'cubic'\?"):
        calibrate_ringdown(run(duration=1.0), restoring="cubik")
