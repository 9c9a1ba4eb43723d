"""Budget of a fit against fits with shifted inputs and a formula."""

from typing import Any

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.uncertainty import Input, propagate
from tests.helpers import PROTOTYPE_MASS
from tests.machines import FREQUENCY, coulomb_run

FREE = ("mu", "damping", "stiffness")
STIFFNESS = PROTOTYPE_MASS * (2 * np.pi * FREQUENCY) ** 2
INPUTS: dict[str, Any] = {
    "mass": fj.Measured(PROTOTYPE_MASS, 2e-3 * PROTOTYPE_MASS),
    "stiffness": STIFFNESS,
    "normal_force": fj.Measured(9.66, 5e-3 * 9.66),
    "displacement_scale": fj.Measured(1.0, 1e-5),
    "time_scale": fj.Measured(1.0, 1e-5),
}


def fitted(rig, record=None):
    return fj.fit(record or coulomb_run(), rig.oscillator(fj.friction.Coulomb(0.05)), FREE, rig=rig)


@pytest.fixture(scope="module")
def rig():
    return fj.Rig(**INPUTS)


@pytest.fixture(scope="module")
def fit(rig):
    return fitted(rig)


def refitted(rig, name, shift):
    """Fit the same record with one input larger by `shift`."""
    record, scale = coulomb_run(), 1.0 + shift
    if name == "displacement_scale":
        return fitted(rig, fj.Record(record.t, scale * record.x, record.sigma))
    if name == "time_scale":
        return fitted(rig, fj.Record(scale * record.t, record.x, record.sigma))
    return fitted(rig.with_inputs({name: INPUTS[name].value + shift}))


def check_sensitivities(fit, name, ends, step, size):
    """Compare sensitivities to an input with differences of two fits."""
    value = lambda fit, quantity: {**fit.values, "dead_band": fit.kinematics["dead_band"].value}[quantity]
    for quantity in ("mu", "damping", "dead_band"):
        budget = fj.uncertainty.budget(fit, name=quantity)
        slope = (value(ends[0], quantity) - value(ends[1], quantity)) / (2 * step)
        # The absolute tolerance covers rounding, for sensitivities of zero.
        assert budget.sensitivities[name] == pytest.approx(slope, rel=1e-5, abs=1e-7 * abs(budget.value / size))


@pytest.mark.parametrize("name", [name for name in INPUTS if name != "stiffness"])
def test_the_sensitivity_is_that_of_fits_with_shifted_inputs(rig, fit, name):
    # The square of the step is below the tolerance, and its effect is above the rounding of a fit.
    step = 1e-3 * INPUTS[name].value if "scale" not in name else INPUTS[name].std
    check_sensitivities(fit, name, [refitted(rig, name, step), refitted(rig, name, -step)], step, INPUTS[name].value)


@pytest.mark.slow
def test_a_drag_of_zero_may_be_uncertain():
    """Differentiate in a drag of zero, which the exact engine cannot do."""
    rig = fj.Rig(**INPUTS, drag=fj.Measured(0.0, 5e-3))
    # The effect of the drag on the residuals must stay below the noise, because the fit weights samples by it.
    step = 2e-4
    ends = [fitted(rig.with_inputs({"drag": change})) for change in (step, -step)]
    check_sensitivities(fitted(rig), "drag", ends, step, 1.0)


def test_the_budget_is_the_combined_standard_error(fit):
    for name in FREE:
        assert fj.uncertainty.budget(fit, name=name).std == pytest.approx(fit.combined_std_errors[name], rel=1e-12)
    for name in ("dead_band", "natural_frequency"):
        assert fj.uncertainty.budget(fit, name=name).std == pytest.approx(fit.kinematics[name].std, rel=1e-9)


def test_far_from_the_rig_the_result_follows_the_exact_law(fit):
    """Use ``mu = omega^2 x_d m/N`` for inputs off by a tenth.

    A linear extrapolation would be wrong by a hundredth.
    """
    budget = fj.uncertainty.budget(fit, inputs={"mass": Input(1.1 * PROTOTYPE_MASS, 1e-3), "normal_force": 0.9 * 9.66})
    other = fitted(fj.Rig(**{**INPUTS, "mass": 1.1 * PROTOTYPE_MASS, "normal_force": 0.9 * 9.66}))
    assert budget.value == pytest.approx(other.values["mu"], rel=1e-7)


def test_monte_carlo_has_the_mean_of_a_ratio(fit):
    """Check the bias of mu by an uncertain load in the denominator.

    It is the square of the relative uncertainty, here of 10 %.
    """
    check = fj.uncertainty.budget(fit, inputs={"normal_force": Input(9.66, 0.966)}).monte_carlo(400_000)
    assert check.mean / check.value - 1 == pytest.approx(0.1**2 + 3 * 0.1**4, abs=6e-4)
    assert not check.agrees


def test_an_input_that_is_a_formula_has_its_parts_in_the_table(fit):
    weight = {"dead_weight": Input(0.985, 2e-5, "kg"), "gravity": Input(9.81, 1e-4, "m/s^2"), "arcuate": "1 +/- 1e-3"}
    load = propagate(lambda dead_weight, gravity, arcuate: dead_weight * gravity * arcuate, weight)
    budget = fj.uncertainty.budget(fit, inputs={"normal_force": load})
    assert {"dead_weight", "gravity", "arcuate"} < set(budget.inputs) and "normal_force" not in budget.inputs
    parts = budget.contributions
    assert parts["arcuate"] == pytest.approx(-1e-3 * budget.value, rel=1e-6)
    assert budget.value == pytest.approx(fit.values["mu"] * 9.66 / load.value, rel=1e-6)


def test_the_scatter_of_runs_takes_the_place_of_the_noise(fit):
    rng = np.random.default_rng(3)
    values = 0.05 * (1 + 0.01 * rng.standard_normal(10))
    from fricjax.fitting.population import population

    runs = population(values, np.full(10, 1e-8))
    budget = fj.uncertainty.budget(fit, scatter=runs)
    assert budget.value == pytest.approx(values.mean())
    assert budget.contributions["scatter from run to run"] == pytest.approx(values.std(ddof=1) / np.sqrt(10), rel=1e-3)
    assert budget.inputs["scatter from run to run"].degrees_of_freedom == 9
    assert "noise of the record" not in budget.inputs


def test_stiffness_and_load_as_in_the_reference():
    """Compare relative budgets of representative inputs.

    They are 1.14e-2 with stiffness and load, and 5.8e-4 with the ratio of masses.
    """
    parts = {"stiffness": 1e-2, "load": 5e-3, "model": 2e-3, "arcuate": 1e-3, "compliance": 5e-4, "reading": 6e-5}
    first = propagate(
        lambda stiffness, load, model, arcuate, compliance, reading: (
            stiffness * model * compliance * reading / (load * arcuate)
        ),
        {name: Input(1.0, std) for name, std in parts.items()},
    )
    assert first.std == pytest.approx(1.14e-2, abs=5e-5)
    shares = [round(100 * first.shares[name]) for name in ("stiffness", "load", "model")]
    assert shares == [77, 19, 3]
    parts = {"bearing": 5e-4, "mass": 2e-4, "arcuate": 2e-4, "compliance": 1e-4, "weight": 2e-5, "gravity": 1e-5}
    second = propagate(
        lambda bearing, mass, arcuate, compliance, weight, gravity: (
            mass * arcuate * compliance / (weight * bearing) * 9.81 / (9.81 * gravity)
        ),
        {name: Input(1.0, std) for name, std in parts.items()},
    )
    assert second.std == pytest.approx(5.8e-4, abs=5e-6)
    assert round(100 * second.shares["bearing"]) == pytest.approx(73, abs=1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"name": "nu"}, "This fit has no 'nu'. Did you mean 'mu'?"),
        ({"inputs": {"load": 1.0}}, "'load' is no uncertain input of this fit."),
        (
            {"rig": fj.Rig(**INPUTS, damping=fj.Measured(0.18, 0.01))},
            "does not know how its values follow damping",
        ),
    ],
)
def test_what_the_fit_does_not_know_is_refused(fit, arguments, sentence):
    with pytest.raises(UsageError) as refusal:
        fj.uncertainty.budget(fit, **arguments)
    assert sentence in str(refusal.value)


def test_another_rig_file_counts_with_its_uncertainties(fit):
    better = fj.Rig(**{**INPUTS, "normal_force": fj.Measured(9.66, 1e-3 * 9.66)})
    budget = fj.uncertainty.budget(fit, better)
    assert budget.measured.relative == pytest.approx(np.hypot(2e-3, 1e-3), rel=1e-2)


def test_a_saved_fit_has_the_same_budget(fit, tmp_path):
    loaded = fj.load_fit(fit.save(tmp_path / "fit.json"))
    assert fj.uncertainty.budget(loaded).contributions == fj.uncertainty.budget(fit).contributions


def test_a_fit_without_a_rig_has_its_noise_alone(fit):
    alone = fj.fit(coulomb_run(), fj.Rig(**INPUTS).oscillator(fj.friction.Coulomb(0.05)), FREE)
    budget = fj.uncertainty.budget(alone)
    assert list(budget.inputs) == ["noise of the record"]
    assert "fit with rig=" in budget.summary()
