"""Verdicts on fits that miss a term, for motions simulated with it."""

import re

import equinox as eqx
import numpy as np
import pytest
from scipy.signal import lfilter

from fricjax import Fit, Oscillator, Record, Trace, fit, fit_batch, synthetic_run
from fricjax.friction import Coulomb, Dahl, LuGre, Stribeck
from fricjax.oscillator.restoring import Cubic
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS
from tests.tiers import cases


def machine(law, damping=PROTOTYPE_DAMPING, **more) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, 1.89, law, **more)


def run(truth: Oscillator):
    return synthetic_run(truth, 2e-3, rate=5e3, duration=2.0, noise=1e-9, seed=3)


def said(found: Fit) -> list[str]:
    return [sentence for sentence in found.warnings if "was tried" in sentence]


MISSING = {
    "drag": (machine(Coulomb(0.01), drag=0.5), "free=['mu', 'damping', 'stiffness', 'drag']"),
    "little drag": (machine(Coulomb(0.01), drag=0.01), "free=['mu', 'damping', 'stiffness', 'drag']"),
    "falling friction": (machine(Stribeck(0.01, 0.013, 0.02)), "friction=Stribeck(...)"),
    "stiffening": (machine(Coulomb(0.01), restoring=Cubic(1e7)), "stiffens with deflection"),
    "softening": (machine(Coulomb(0.01), restoring=Cubic(-1e7)), "softens with deflection"),
}


@pytest.mark.parametrize("term", cases(MISSING, ["drag", "little drag"]))
def test_the_missing_term_is_named_after_a_trial(term):
    truth, command = MISSING[term]
    found = fit(run(truth), machine(Coulomb(0.01)), MACHINE)
    assert re.match(r"does not describe: .* would \(.* -> 1.0\d nm\)", found.status) and not found.described
    assert len(said(found)) == 1 and command in said(found)[0]


CONTACTS = {"Dahl": machine(Dahl(0.01, 1e4)), "LuGre": machine(LuGre(0.01, sigma0=3e4, sigma1=60.0))}


@pytest.mark.slow
@pytest.mark.parametrize("truth", CONTACTS.values(), ids=CONTACTS.keys())
def test_a_contact_that_no_trial_describes_is_not_described(truth):
    found = fit(run(truth), machine(Coulomb(0.01)), MACHINE)
    assert found.status.startswith("does not describe: no cause found")


@pytest.mark.slow
def test_a_fixed_damping_is_tried():
    held = machine(Coulomb(0.01), damping=0.5 * PROTOTYPE_DAMPING)
    found = fit(run(machine(Coulomb(0.01))), held, ("mu", "stiffness"), throw=False)
    assert "viscous damping would" in found.status


@pytest.mark.slow
def test_the_right_model_is_described():
    truth = machine(Coulomb(0.01), drag=0.5)
    found = fit(run(truth), machine(Coulomb(0.01)), (*MACHINE, "drag"))
    assert found.chi2_reduced == pytest.approx(1, abs=0.1) and not said(found)
    assert found.values["drag"] == pytest.approx(0.5, rel=1e-3)
    assert not said(fit(run(machine(Coulomb(0.01))), machine(Coulomb(0.01)), MACHINE))


@pytest.mark.slow
@pytest.mark.parametrize("duration", [1.5, 3.0])
def test_a_missing_drag_is_no_floor_vibration(duration):
    """Do not explain a missing drag by floor vibration.

    Floor vibration can explain any motion, but here the rest excludes it.
    With floor vibration, the fit would converge with mu off by 12 standard errors.
    """
    truth = machine(Coulomb(0.02), drag=2.0)
    record = synthetic_run(truth, 1e-3, rate=1e3, duration=duration, noise=5e-9, seed=0)
    found = fit(record, machine(Coulomb(0.02)), MACHINE, throw=False)
    assert found.status.startswith("does not describe: quadratic drag")
    assert "'drag'" in said(found)[0]


STIFF = Oscillator(1.0, 5000.0, 4.3, 9.81, Coulomb(0.0489))
FEW = {
    "drag": (eqx.tree_at(lambda o: o.drag, STIFF, 4.9), 1.25e-3),
    "drag, three half-cycles": (eqx.tree_at(lambda o: o.drag, STIFF, 5.1), 0.98e-3),
    "stiffening": (eqx.tree_at(lambda o: o.restoring, STIFF, Cubic(5.6e7)), 1.1e-3),
    "falling friction": (eqx.tree_at(lambda o: o.friction, STIFF, Stribeck(0.0489, 0.0587, 4e-3)), 1.2e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("truth, x0", FEW.values(), ids=FEW.keys())
def test_few_half_cycles_show_the_missing_term(truth, x0):
    """Name the term in a record of a few half-cycles.

    With floor vibration alone, the fit would converge with damping or stiffness off by 9 to 15 standard errors.
    """
    record = synthetic_run(truth, x0, rate=1e4, duration=1.4, noise=50e-9, seed=0)
    found = fit(record, STIFF, MACHINE, throw=False)
    true = {"mu": 0.0489, "damping": 4.3, "stiffness": 5000.0}
    scores = [(found.values[name] - value) / found.std_errors[name] for name, value in true.items()]
    assert np.max(np.abs(scores)) < 3 and said(found)


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("duration", [0.3, 1.5])
def test_a_long_rest_hides_no_missing_term(duration):
    """Compare residuals with the noise during the motion only.

    In motion the residuals are 26 times the noise, over the whole record 10 times.
    With the latter, the fit would converge with mu off by 17 standard errors.
    """
    loaded = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.02))
    truth = eqx.tree_at(lambda o: o.drag, loaded, 2.0)
    record = synthetic_run(truth, 1e-3, rate=1e4, duration=duration, noise=5e-9, seed=0)
    found = fit(record, loaded, MACHINE, throw=False)
    batch = fit_batch([record] * 2, loaded, MACHINE)
    assert found.status.startswith("does not describe") and "'drag'" in said(found)[0]
    assert batch.status[0].startswith("does not describe") and "'drag'" in " ".join(batch.warnings[0])


def remembering(record: Trace, seed: int) -> Trace:
    """Add 10 nm of noise with a correlation length of ten samples."""
    noise = lfilter([1], [1, -0.9], np.random.default_rng(seed).normal(size=record.t.size)) * np.sqrt(1 - 0.9**2)
    return Trace(record.t, np.asarray(record.x) + 10e-9 * noise)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_standard_errors_include_the_shift_by_a_missing_drag(seed):
    """Include a small drag in the standard error of mu.

    The drag is hidden by noise. It moves mu by tens of standard errors for white noise.
    """
    record = remembering(
        synthetic_run(machine(Coulomb(0.01), drag=0.1), 2e-3, rate=5e3, duration=0.5, seed=seed).trace, seed
    )
    without, fitted = (fit(record, machine(Coulomb(0.01)), (*MACHINE, *more)) for more in ((), ("drag",)))
    (sentence,) = said(without)
    assert "'drag'" in sentence
    assert abs(without.values["mu"] - 0.01) < 3 * without.std_errors["mu"]
    assert without.std_errors["mu"] > 10 * without.white_std_errors["mu"]
    assert abs(fitted.values["mu"] - 0.01) < 3 * fitted.std_errors["mu"] and not said(fitted)


def test_correlated_noise_is_described():
    record = synthetic_run(machine(Coulomb(0.01)), 2e-3, rate=5e3, duration=0.5, seed=0).trace
    for seed in range(3):
        found = fit(remembering(record, seed), machine(Coulomb(0.01)), MACHINE)
        assert not said(found) and abs(found.values["mu"] - 0.01) < 4 * found.std_errors["mu"]


@pytest.mark.slow
def test_shifts_have_the_unit_of_the_rig():
    record = Record(run(machine(Coulomb(0.01), drag=0.5)).trace, {"quantity": "rad"})
    (sentence,) = said(fit(record, machine(Coulomb(0.01)), MACHINE, throw=False))
    assert re.search(r"damping by \S+ N m s/rad", sentence)
