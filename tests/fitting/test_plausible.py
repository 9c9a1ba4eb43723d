"""Warnings about implausible values, with the likely mistake."""

import numpy as np
import pytest

from fricjax import Oscillator, Record, Trace, fit, fit_batch, load_fit
from fricjax.friction import Coulomb
from fricjax.oscillator.restoring import Pendulum
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import FREQUENCY, MACHINE, RIGS, STIFFNESS, X0, ZETA, coulomb_run, oscillator
from tests.oracles import coulomb_viscous

pytestmark = pytest.mark.slow

MODEL = oscillator(RIGS["sliding"], "Coulomb")
LOAD = RIGS["sliding"].load
# Static and dynamic coefficients are separate parameters.
APART = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD, Coulomb(0.05, 0.05))


def remarks(told, word: str) -> list[str]:
    return [sentence for sentence in told if word in sentence]


@pytest.fixture(scope="module")
def wrong():
    """Fit a record in millimetres that was read as metres."""
    return coulomb_run(scale=1e3)


def test_a_coefficient_that_no_friction_has_is_remarked_on(wrong):
    found = fit(wrong, MODEL, MACHINE)
    assert found.values["mu"] == pytest.approx(50.0, rel=1e-5)
    assert remarks(found.warnings, "mu = 50 is larger than any coefficient of friction: check the units")
    assert remarks(found.warnings, "The amplitude of 1.8 m is larger than that of any friction oscillator")
    assert "implausible" in found.flags["mu"]


@pytest.mark.usefixtures("small_chunks")
def test_the_rows_of_a_batch_are_remarked_on(wrong):
    batch = fit_batch([coulomb_run(), wrong], MODEL, MACHINE)
    assert not batch.warnings[0] and "implausible" not in batch.flags[0]["mu"]
    assert remarks(batch.warnings[1], "mu = 50 is larger") and remarks(batch.warnings[1], "The amplitude of 1.8 m")
    assert "implausible" in batch.flags[1]["mu"]
    assert "check the unit of the displacement" in batch.to_dataframe()["warnings"][1]


@pytest.mark.parametrize(
    ("mass", "stiffness", "sentence"),
    [
        (1e3 * PROTOTYPE_MASS, STIFFNESS, "a mass in g entered as kg"),
        (PROTOTYPE_MASS, 1e-3 * STIFFNESS, "a stiffness in N/mm entered as N/m."),
        (PROTOTYPE_MASS, 1e3 * STIFFNESS, "Typical cause: a stiffness in N/m entered as N/mm."),
        (PROTOTYPE_MASS, 30 * STIFFNESS, "check stiffness and mass"),
    ],
)
def test_a_machine_that_cannot_swing_as_the_record_does_is_remarked_on(mass, stiffness, sentence):
    machine = Oscillator(mass, stiffness, PROTOTYPE_DAMPING * mass / PROTOTYPE_MASS, LOAD, Coulomb(0.05))
    swings = f"a natural frequency of {FREQUENCY * np.sqrt(stiffness / STIFFNESS * PROTOTYPE_MASS / mass):.4g} Hz"
    (remark,) = remarks(fit(coulomb_run(), machine, MACHINE, throw=False).warnings, "Stiffness and mass give")
    assert swings in remark and f"the record oscillates at {FREQUENCY:.4g} Hz" in remark and sentence in remark


def test_times_in_milliseconds_taken_for_seconds_are_remarked_on():
    run = coulomb_run()
    slow = Trace(1e3 * np.asarray(run.t), run.x, sigma=run.sigma)
    (remark,) = remarks(fit(slow, MODEL, MACHINE, throw=False).warnings, "Stiffness and mass give")
    assert remark.endswith("Typical cause: times in ms read as s.")


@pytest.mark.parametrize(("mass", "stiffness"), [(PROTOTYPE_MASS, 2 * STIFFNESS), (1.0, 1.0), (PROTOTYPE_MASS, 1.0)])
def test_a_start_value_twice_off_or_left_open_is_no_mistake(mass, stiffness):
    machine = Oscillator(mass, stiffness, PROTOTYPE_DAMPING, LOAD, Coulomb(0.05))
    assert not remarks(fit(coulomb_run(), machine, MACHINE).warnings, "Stiffness and mass give")


def test_per_unit_of_load_a_coefficient_may_have_any_size():
    found = fit(coulomb_run(scale=10.0), Oscillator(1.0, 4000.0, 0.0, 1.0, Coulomb(0.1)), MACHINE)
    assert found.values["mu"] > 10 and not remarks(found.warnings, "larger than")


@pytest.mark.parametrize("by", ["quantity", "spring"])
def test_degrees_taken_for_radians_are_remarked_on(by):
    """Fit a swing of 5 degrees to each side, read as radians."""
    run = coulomb_run(scale=5.0 / X0)
    data = Record(run, {"quantity": "rad"}) if by == "quantity" else run
    spring = {} if by == "quantity" else {"restoring": Pendulum()}
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD * 2500, Coulomb(0.05), **spring)
    found = fit(data, machine, MACHINE, throw=False)
    assert remarks(found.warnings, "rad, more than a full turn: were degrees taken for radians?")
    assert not remarks(found.warnings, "The amplitude")


@pytest.fixture(scope="module")
def disagreeing() -> tuple[list[Trace], float, float]:
    """Two runs with different static friction, and their limits of the coefficient.

    One mass stops 455 um from the equilibrium, which gives the lower limit. The other one moves on at 358 um, which
    gives the upper limit. Both limits come from the closed form.
    """
    points = [
        coulomb_viscous(
            np.zeros(1), x0, frequency=FREQUENCY, zeta=ZETA, dead_band=0.05 * LOAD / STIFFNESS,
            static_band=mu_s * LOAD / STIFFNESS,
        ).points
        for x0, mu_s in ((2e-3, 0.125), (1.9e-3, 0.05))
    ]  # fmt: skip
    stop, moved_on = (abs(points[0][-1]) * STIFFNESS / LOAD, abs(points[1][-2]) * STIFFNESS / LOAD)
    return [coulomb_run(2e-3, mu_s=0.125), coulomb_run(1.9e-3, mu_s=0.05, seed=1)], stop, moved_on


def test_stops_that_disagree_on_static_friction_are_said_to(disagreeing, tmp_path):
    runs, stop, moved_on = disagreeing
    assert moved_on < stop
    found = fit(runs, APART, ("mu", "mu_s", "damping", "stiffness"))
    assert found.intervals["mu_s"] == pytest.approx((moved_on, stop), rel=1e-4)
    assert np.isnan(found.values["mu_s"])
    assert found.flags["mu_s"] == ("bracketed, not fitted", "differs from stop to stop")
    assert float(found.oscillator.friction.mu_s) == pytest.approx(found.values["mu"])  # type: ignore[attr-defined]
    assert remarks(found.warnings, f"require at least {stop:.4g}, but the mass moved on where it must be below")
    assert np.all(np.isfinite(found.predict(found.times[0])))
    assert "differs from stop to stop" in found.summary()
    assert np.isnan(load_fit(found.save(tmp_path / "fit.json")).values["mu_s"])


def test_also_where_the_static_coefficient_was_not_asked_for(disagreeing):
    found = fit(disagreeing[0], MODEL, MACHINE, throw=False)
    assert remarks(found.warnings, "No static coefficient agrees with all stops")
    assert "mu_s" not in found.values
    assert "mu_s:        differs from stop to stop, over [" in found.summary()


def test_stops_that_agree_are_not_remarked_on():
    found = fit(coulomb_run(mu_s=0.065), APART, ("mu", "mu_s", "damping", "stiffness"))
    assert not remarks(found.warnings, "static coefficient")
    low, high = found.intervals["mu_s"]
    assert found.values["mu_s"] == pytest.approx((low + high) / 2)
