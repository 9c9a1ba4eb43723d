"""Fits of published pendulum records, measured with encoders."""

import numpy as np
import pytest

from fricjax import Fit, Oscillator, fit, read
from fricjax.friction import Coulomb
from fricjax.oscillator.restoring import Pendulum

SMALL = "multiarm-pendulum/SingleDataFreeSwing_1_Dt_0_0001.mat"
LARGE = "multiarm-pendulum/SinglePendulumDataForParameterEstimation.mat"
ROTARY = "rotary-pendulum/data03.txt"
FREE = ("mu", "damping", "stiffness")
# Bounds that exclude a coefficient. Fits with and without it then share one compilation.
NONE = (0.0, 1e-12)


def pendulum(mu: float = 0.1, drag: float = 0.0) -> Oscillator:
    """Pendulum with unit inertia and load.

    mu is then the deceleration by dry friction [rad/s^2].
    """
    return Oscillator(1.0, 50.0, 0.0, 1.0, Coulomb(mu), restoring=Pendulum(), drag=drag)


@pytest.fixture(scope="module")
def small(measured_data):
    return read(measured_data(SMALL), column="Theta1", unit="rad")


@pytest.fixture(scope="module")
def large(measured_data):
    columns = {"column": ["Y_id", "Y_vad"], "time": ["Time_id", "Time_vad"]}
    return read(measured_data(LARGE), unit="rad", **columns)


@pytest.fixture(scope="module")
def rotary(measured_data):
    return read(measured_data(ROTARY), unit="deg", rate=1000.0)


@pytest.fixture(scope="module")
def small_both(small) -> Fit:
    return fit(small, pendulum(), FREE)


@pytest.fixture(scope="module")
def dry_alone(small) -> float:
    """Deceleration by friction of the small swing, without damping [rad/s^2]."""
    return fit(small, pendulum(), FREE, bounds={"damping": NONE}).kinematics["friction_deceleration"].value


def assert_misses(found: Fit, *parts: str):
    """Check that the optimum was found but does not describe the record."""
    assert found.optimum_found and not found.described
    for part in ("does not describe: no cause found; ", *parts):
        assert part in found.status, found.status


def assert_honest(found: Fit):
    """Check that the fit reports the coloured residuals of an encoder."""
    assert not found.whiteness.white
    # Residuals of up to ten times the noise are treated as noise, unless a trial is better.
    assert not found.described or any("are treated as slow noise" in sentence for sentence in found.warnings)
    for name in found.names:
        assert found.std_errors[name] > 10 * found.white_std_errors[name] or "at bound" in found.flags[name], name
    assert "Statistical (white noise)" in found.summary()


@pytest.mark.slow
def test_small_swing_with_dry_and_viscous_friction(small_both):
    assert small_both.quantity == "rad"
    assert_misses(small_both, "1.03 mrad (3.9 % of the motion) are unexplained")
    assert small_both.residual_rms <= 6.0e-4 and small_both.stages <= 3
    assert small_both.residual_rms == pytest.approx(5.3e-4, rel=0.03)
    assert small_both.values["mu"] == pytest.approx(0.152, rel=0.03)
    assert small_both.values["damping"] == pytest.approx(0.061, rel=0.1)
    assert small_both.values["offset"] == pytest.approx(np.pi, abs=1e-3)
    # The window includes the rest: 23 s of record without the first third of a second.
    assert np.isfinite(small_both.residuals).sum() > 0.95 * small_both.residuals.size
    assert_honest(small_both)


@pytest.mark.slow
def test_small_swing_with_dry_friction_alone(dry_alone):
    assert dry_alone == pytest.approx(0.162, rel=0.01)


@pytest.mark.slow
def test_small_swing_with_viscous_friction_alone_is_as_bad_as_it_is(small, small_both):
    found = fit(small, pendulum(mu=0.0), ("damping", "stiffness"))
    assert found.residual_rms == pytest.approx(2.4e-3, rel=0.1)
    assert found.residual_rms > 4 * small_both.residual_rms
    assert found.aicc > small_both.aicc and found.bic > small_both.bic
    assert_honest(found)
    assert found.problem is not None
    in_motion = np.sqrt(np.mean(found.residuals[found.problem.windows[0].moving] ** 2))
    assert not found.described and in_motion > found.residual_rms


@pytest.fixture(scope="module")
def large_bounded(large) -> Fit:
    return fit(large, pendulum(drag=0.004), (*FREE, "drag"), bounds={"damping": (0, None), "drag": (0, None)})


@pytest.mark.slow
def test_large_swing_with_drag_and_bounded_damping(large_bounded, dry_alone):
    assert large_bounded.residual_rms <= 8.0e-3
    assert large_bounded.residual_rms == pytest.approx(7.4e-3, rel=0.03)
    assert large_bounded.kinematics["friction_deceleration"].value == pytest.approx(dry_alone, rel=0.05)
    assert large_bounded.kinematics["drag_rate"].value == pytest.approx(0.0040, rel=0.05)
    assert large_bounded.values["damping"] == 0.0 and large_bounded.flags["damping"] == ("at bound",)
    assert_misses(large_bounded, "residuals of 7.39 mrad are 212 times the noise")
    assert_honest(large_bounded)


@pytest.mark.slow
def test_large_swing_without_the_bound_warns_of_negative_damping(large, large_bounded):
    found = fit(large, pendulum(drag=0.004), (*FREE, "drag"))
    assert_misses(found, "damping is negative by ")
    assert found.residual_rms == pytest.approx(2.8e-3, rel=0.05)
    assert found.values["damping"] == pytest.approx(-0.028, rel=0.1)
    assert found.values["mu"] == pytest.approx(0.234, rel=0.05)
    assert "damping is negative" in found.summary()
    assert "negative" not in large_bounded.summary()


@pytest.mark.slow
def test_large_swing_with_viscous_friction_alone_is_as_bad_as_it_is(large):
    found = fit(large, pendulum(), (*FREE, "drag"), bounds={"mu": NONE, "drag": NONE})
    assert found.residual_rms == pytest.approx(2.79e-2, rel=0.15)
    assert_honest(found)


@pytest.mark.slow
def test_rotary_pendulum(rotary):
    both = fit(rotary, pendulum(mu=2.0), FREE)
    assert both.converged and both.residual_rms <= 4.6e-3
    # A hand holds the pendulum until 0.4 s. No sample before the first reversal is used.
    assert both.origins[0] > 0.4 and np.isnan(both.residuals[: int(1e3 * both.origins[0])]).all()
    assert_honest(both)
    viscous = fit(rotary, pendulum(mu=2.0), FREE, bounds={"mu": NONE})
    assert viscous.residual_rms == pytest.approx(2.35e-2, rel=0.1)
    assert viscous.residual_rms > 5 * both.residual_rms
    assert_honest(viscous)
