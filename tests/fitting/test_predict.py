"""Predictions inside the record and behind its end, until the mass stops."""

import numpy as np
import pytest

from fricjax import Oscillator, Trace, fit, load_fit, simulate
from fricjax.friction import Coulomb, Stribeck, Tanh
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, X0, coulomb_run, displacement, noisy, oscillator

pytestmark = pytest.mark.slow

LOAD = 9.66


def machine(friction) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD, friction)


def cut(law, seconds: float, seed: int = 0) -> Trace:
    """Run that ends in motion."""
    t = np.arange(round(40e3 * seconds)) / 40e3
    x = np.asarray(simulate(machine(law), X0, t).x)
    return Trace(t, x + 1e-9 * np.random.default_rng(seed).standard_normal(t.size), sigma=1e-9)


def test_behind_the_end_of_a_rolling_run_the_mass_stops_where_the_law_stops_it(tmp_path):
    """Predict the stop behind the end of a record.

    The run of 2 s ends in motion. In closed form, the mass stops at 3.6 s.
    """
    run, machine = noisy("rolling", "Coulomb", 0), oscillator(RIGS["rolling"], "Coulomb")
    found = fit(run, machine, MACHINE)
    assert found.half_cycles == (None,)
    later = np.array([2.1, 2.9, 3.5, 4.0, 10.0, 100.0])
    true = displacement(RIGS["rolling"], "Coulomb", later)
    assert true[-1] == pytest.approx(6.92e-6, abs=1e-8)
    assert found.predict(later) == pytest.approx(true, abs=2e-8)
    found.save(tmp_path / "fit.json")
    assert load_fit(tmp_path / "fit.json").predict(later) == pytest.approx(found.predict(later), abs=1e-15)


def test_times_may_come_in_any_order_and_from_both_sides_of_the_end():
    run, machine = noisy("rolling", "Coulomb", 0), oscillator(RIGS["rolling"], "Coulomb")
    found = fit(run, machine, MACHINE)
    times = np.array([5.0, 0.7, 2.5, 5.0, 1.9])
    assert found.predict(times) == pytest.approx(displacement(RIGS["rolling"], "Coulomb", times), abs=2e-8)
    seen = np.isfinite(found.residuals)
    inside = found.predict(np.asarray(run.t)[seen])
    assert found.residuals[seen] == pytest.approx(np.asarray(run.x)[seen] - inside, abs=1e-14)
    both = found.predict(np.append(np.asarray(run.t)[seen], 5.0))
    assert both[:-1] == pytest.approx(inside, abs=1e-15)


@pytest.mark.parametrize(
    "law",
    [Coulomb(0.05), Stribeck(0.05, 0.065, v_stribeck=5e-3), Tanh(0.05, 1e-4)],
    ids=["Coulomb", "Stribeck", "Tanh"],
)
def test_a_sliding_run_cut_in_motion_goes_on_as_its_law_has_it(law):
    """Compare the prediction of each law with the full motion."""
    found = fit(cut(law, 0.15), machine(law), MACHINE, throw=False)
    later = np.array([0.16, 0.25, 0.3, 0.6, 1.0])
    true = np.asarray(simulate(machine(law), X0, later).x)
    assert found.predict(later) == pytest.approx(true, abs=1e-7)


def test_where_the_static_coefficient_is_bracketed_the_middle_of_its_interval_stops_the_mass():
    found = fit(cut(Coulomb(0.05), 0.15), machine(Coulomb(0.05, 0.05)), ("mu", "mu_s", "damping", "stiffness"))
    static = float(found.oscillator.friction.mu_s) * LOAD  # type: ignore[attr-defined]
    rest = found.predict([10.0, 20.0]) - found.values["offset"]
    assert rest[0] == rest[1] and abs(rest[0]) <= static / STIFFNESS


def test_a_law_that_would_stop_the_mass_inside_the_record_is_remarked_on():
    """Fit with a static friction of 0.4.

    It would hold the mass at the third reversal, 0.83 mm from the equilibrium.
    """
    run = cut(Coulomb(0.05), 0.15)
    points = np.asarray(simulate(machine(Coulomb(0.05)), X0, np.array([1.0])).turning_points)
    sticky = fit(run, machine(Coulomb(0.05, 0.4)), MACHINE, throw=False)
    (remark,) = (sentence for sentence in sticky.warnings if "inside the record" in sentence)
    assert f"is {0.4 * LOAD / STIFFNESS - abs(points[3]):.2e} m too small" in remark
    assert not any("inside the record" in sentence for sentence in fit(run, machine(Coulomb(0.05)), MACHINE).warnings)
    # Behind the end, the law stops the mass at the next reversal.
    assert sticky.predict([0.2, 5.0]) == pytest.approx([points[4], points[4]], abs=2e-8)


def test_a_run_that_comes_to_rest_stays_there():
    found = fit(coulomb_run(), machine(Coulomb(0.05)), MACHINE)
    assert found.predict([0.39, 50.0])[1] == pytest.approx(found.predict([0.39])[0], abs=1e-15)
