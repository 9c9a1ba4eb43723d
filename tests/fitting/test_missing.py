"""What a fit says that its model lacks, for motions that were computed with it."""

import pytest

from fricjax import Fit, Oscillator, fit, synthetic_run
from fricjax.friction import Coulomb, Dahl, LuGre, Stribeck
from fricjax.oscillator.restoring import Cubic
from tests.fitting.runs import MACHINE, STIFFNESS
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS


def machine(law, damping=PROTOTYPE_DAMPING, **more) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, 1.89, law, **more)


def run(truth: Oscillator):
    return synthetic_run(truth, 2e-3, rate=5e3, duration=2.0, noise=1e-9, seed=3)


def said(found: Fit) -> list[str]:
    return [sentence for sentence in found.warnings if "would move" in sentence]


LACKING = {
    "drag": (machine(Coulomb(0.01), drag=0.5), "free=['mu', 'damping', 'stiffness', 'drag']"),
    "little drag": (machine(Coulomb(0.01), drag=0.01), "free=['mu', 'damping', 'stiffness', 'drag']"),
    "falling friction": (machine(Stribeck(0.01, 0.013, 0.02)), "friction=Stribeck(...)"),
    "Dahl contact": (machine(Dahl(0.01, 1e4)), "friction=Dahl(...)"),
    "LuGre contact": (machine(LuGre(0.01, sigma0=3e4, sigma1=60.0)), "friction=Dahl(...)"),
    "stiffening": (machine(Coulomb(0.01), restoring=Cubic(1e7)), "stiffens with deflection"),
    "softening": (machine(Coulomb(0.01), restoring=Cubic(-1e7)), "softens with deflection"),
}


@pytest.mark.parametrize("truth, command", LACKING.values(), ids=LACKING.keys())
def test_what_is_lacking_is_named(truth, command):
    found = fit(run(truth), machine(Coulomb(0.01)), MACHINE, throw=False)
    assert found.status.startswith("does not describe")
    assert len(said(found)) == 1 and command in said(found)[0]


def test_a_damping_that_is_held_is_lacking():
    held = machine(Coulomb(0.01), damping=0.5 * PROTOTYPE_DAMPING)
    found = fit(run(machine(Coulomb(0.01))), held, ("mu", "stiffness"), throw=False)
    assert "viscous damping" in said(found)[0]


def test_nothing_is_lacking_from_the_right_model_and_with_what_was_lacking_it_is_right():
    truth = machine(Coulomb(0.01), drag=0.5)
    found = fit(run(truth), machine(Coulomb(0.01)), (*MACHINE, "drag"))
    assert found.chi2_reduced == pytest.approx(1, abs=0.1) and not said(found)
    assert found.values["drag"] == pytest.approx(0.5, rel=1e-3)
    assert not said(fit(run(machine(Coulomb(0.01))), machine(Coulomb(0.01)), MACHINE))


@pytest.mark.parametrize("duration", [1.5, 3.0])
def test_a_quiet_rest_makes_no_shaken_floor_of_what_is_lacking(duration):
    """Kicks of the floor explain any motion, and none shows in the rest: "converged", mu 12 standard errors off."""
    truth = machine(Coulomb(0.02), drag=2.0)
    record = synthetic_run(truth, 1e-3, rate=1e3, duration=duration, noise=5e-9, seed=0)
    found = fit(record, machine(Coulomb(0.02)), MACHINE, throw=False)
    assert found.status.startswith("does not describe") and found.noises[0].floor == 0
    assert "'drag'" in said(found)[0]
