"""Budgets against examples of the GUM and its supplement 1, and draws."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.uncertainty import Input, propagate


def end_gauge():
    """Calibration of an end gauge by comparison (JCGM 100:2008, H.1), in nm."""
    inputs = {
        "standard": Input(50_000_623.0, 25.0, degrees_of_freedom=18),
        "difference": Input(215.0, 9.7, degrees_of_freedom=25.6),
        "expansion": Input(11.5e-6, 1.2e-6),
        "temperature": Input(-0.1, 0.41),
        "expansion_difference": Input(0.0, 0.58e-6, degrees_of_freedom=50),
        "temperature_difference": Input(0.0, 0.029, degrees_of_freedom=2),
    }

    def length(standard, difference, expansion, temperature, expansion_difference, temperature_difference):
        change = expansion_difference * temperature + expansion * temperature_difference
        return standard + difference - standard * change

    return propagate(length, inputs, quantity="length", unit="nm")


def test_the_end_gauge_of_the_gum():
    budget = end_gauge()
    assert budget.value == pytest.approx(50_000_838, abs=0.5)
    assert round(budget.std) == 32
    assert math.floor(budget.degrees_of_freedom) == 16
    expanded = budget.expanded(0.99)
    assert (round(expanded.half_width), round(expanded.factor, 2)) == (93, 2.92)
    parts = {name: abs(part) for name, part in budget.contributions.items()}
    assert parts["expansion_difference"] == pytest.approx(2.9, abs=0.05)
    assert parts["temperature_difference"] == pytest.approx(16.6, abs=0.1)
    assert parts["expansion"] == parts["temperature"] == 0


def impedance(formula, name):
    """Resistance, reactance and impedance from correlated readings (JCGM 100:2008, H.2)."""
    inputs = {"V": Input(4.9990, 0.0032), "I": Input(19.661e-3, 0.0095e-3), "phase": Input(1.04446, 0.00075)}
    correlations = {("V", "I"): -0.36, ("V", "phase"): 0.86, ("I", "phase"): -0.65}
    return propagate(formula, inputs, quantity=name, unit="Ohm", correlations=correlations)


@pytest.mark.parametrize(
    ("formula", "value", "std"),
    [
        (lambda V, I, phase: V / I * jnp.cos(phase), 127.732, 0.071),
        (lambda V, I, phase: V / I * jnp.sin(phase), 219.847, 0.295),
        (lambda V, I, phase: V / I + 0 * phase, 254.260, 0.236),
    ],
    ids=["R", "X", "Z"],
)
def test_the_correlated_readings_of_the_gum(formula, value, std):
    budget = impedance(formula, "R")
    assert budget.value == pytest.approx(value, abs=1e-3)
    # The standard has rounded its inputs and correlations to two digits.
    assert budget.std == pytest.approx(std, rel=0.02)
    assert sum(budget.shares.values()) == pytest.approx(1.0)
    check = budget.monte_carlo(200_000)
    assert check.std == pytest.approx(budget.std, rel=0.01)


def test_four_normal_inputs_of_the_supplement():
    """Compare with JCGM 101:2008, 9.2.2: u = 2.0, interval 3.92."""
    budget = propagate(lambda a, b, c, d: a + b + c + d, {name: Input(0.0, 1.0) for name in "abcd"})
    check = budget.monte_carlo()
    assert budget.std == pytest.approx(2.0)
    assert check.interval == pytest.approx((-3.92, 3.92), abs=0.02)
    assert check.agrees


def test_four_rectangular_inputs_of_the_supplement():
    """Compare with JCGM 101:2008, 9.2.3.

    The first-order interval is 3.92, that of the distributions 3.88.
    """
    inputs = {name: Input.rectangular(0.0, math.sqrt(3)) for name in "abcd"}
    check = propagate(lambda a, b, c, d: a + b + c + d, inputs).monte_carlo()
    assert check.std == pytest.approx(2.0, abs=0.005)
    assert check.shortest == pytest.approx((-3.88, 3.88), abs=0.03)
    assert check.budget_interval == pytest.approx((-3.92, 3.92), abs=0.01)


def test_one_dominant_rectangular_input_of_the_supplement():
    """Compare with JCGM 101:2008, 9.2.4.

    u = 10.1, and the shortest interval is 17.0. The interval of the budget, 19.8, is not validated.
    """
    inputs = {name: Input.rectangular(0.0, math.sqrt(3)) for name in "abc"}
    inputs["d"] = Input.rectangular(0.0, 10 * math.sqrt(3))
    budget = propagate(lambda a, b, c, d: a + b + c + d, inputs)
    check = budget.monte_carlo()
    assert budget.std == pytest.approx(10.1, abs=0.1)
    assert check.shortest == pytest.approx((-17.0, 17.0), abs=0.1)
    assert check.budget_interval == pytest.approx((-19.9, 19.9), abs=0.1)
    assert not check.agrees
    assert "Use Monte Carlo's" in check.summary()


@pytest.mark.parametrize("shape", ["normal", "rectangular", "triangular", "arcsine"])
def test_draws_have_the_standard_uncertainty_of_their_distribution(shape):
    drawn = Input(2.0, 0.3, distribution=shape).draw(np.random.default_rng(1), 400_000)
    assert drawn.mean() == pytest.approx(2.0, abs=0.003)
    assert drawn.std() == pytest.approx(0.3, rel=0.005)
    ends = {"rectangular": math.sqrt(3), "triangular": math.sqrt(6), "arcsine": math.sqrt(2)}
    if shape in ends:
        assert np.abs(drawn - 2.0).max() <= 0.3 * ends[shape] * (1 + 1e-12)


def test_readings_are_drawn_from_student():
    drawn = Input.of_readings([1.0, 2.0, 3.0, 4.0]).draw(np.random.default_rng(1), 400_000)
    # The variance of JCGM 101, 6.4.9.4, u^2 (n - 1)/(n - 3), scatters too much for four readings. Quantiles do not.
    from scipy.stats import t

    scale = math.sqrt(5 / 3 / 4)
    expected = 2.5 + scale * t.ppf([0.025, 0.975], 3)
    assert np.quantile(drawn, [0.025, 0.975]) == pytest.approx(expected, rel=0.02)


SIZES, PARTS = st.floats(0.1, 10.0), st.floats(1e-4, 0.1)


@given(a=SIZES, b=SIZES, u=PARTS, v=PARTS, r=st.floats(-1.0, 1.0))
def test_a_product_follows_its_closed_form(a, b, u, v, r):
    inputs = {"a": Input(a, u * a), "b": Input(b, v * b)}
    budget = propagate(lambda a, b: a * b, inputs, correlations={("a", "b"): r})
    assert budget.measured.relative == pytest.approx(
        math.sqrt(max(u**2 + v**2 + 2 * r * u * v, 0.0)), rel=1e-6, abs=1e-9
    )


def test_a_budget_within_a_budget_is_one_budget():
    weight = {"mass": Input(0.98, 2e-5, "kg"), "gravity": Input.rectangular(9.81, 1e-4, "m/s^2")}
    load = propagate(lambda mass, gravity: mass * gravity, weight, correlations={("mass", "gravity"): 0.0})
    nested = propagate(lambda load, band: 2574.0 * band / load, {"load": load, "band": Input(1e-4, 1e-8)})
    flat = propagate(
        lambda mass, gravity, band: 2574.0 * band / (mass * gravity), {**weight, "band": Input(1e-4, 1e-8)}
    )
    assert nested.value == flat.value
    assert nested.contributions == pytest.approx(flat.contributions, rel=1e-12)
    assert np.array_equal(nested.monte_carlo(20_000).sample, flat.monte_carlo(20_000).sample)


def test_the_number_of_the_package_uncertainties_knows_its_inputs():
    budget = impedance(lambda V, I, phase: V / I * jnp.cos(phase), "R")
    number = budget.to_uncertainties()
    assert number.nominal_value == pytest.approx(budget.value)
    assert number.std_dev == pytest.approx(budget.std, rel=1e-9)
    assert (number - number).std_dev == 0


@pytest.mark.parametrize(
    ("inputs", "more", "sentence"),
    [
        ({"a": "heavy", "b": 1.0}, {}, "'heavy' is no number with its uncertainty in SI units, such as"),
        ({"a": "9.66 +/- 0.05 N", "b": 1.0}, {}, "is no number with its uncertainty in SI units"),
        ({"a": 1.0, "b": 1.0}, {"correlations": {("a", "c"): 0.5}}, "There is no input 'c' to correlate."),
        (
            {"a": 1.0, "b": 1.0},
            {"correlations": {("a", "b"): 1.5}},
            "The correlation of a and b must be between -1 and 1",
        ),
        ({"a": 0.0, "b": 0.0}, {}, "or its derivative is not finite at the values of the inputs"),
    ],
)
def test_what_is_no_budget_is_refused_in_one_sentence(inputs, more, sentence):
    with pytest.raises(UsageError) as refusal:
        propagate(lambda a, b: a / b, inputs, **more)
    assert sentence in str(refusal.value)


def test_correlations_that_contradict_one_another_are_refused():
    inputs = {name: Input(1.0, 0.1) for name in "abc"}
    pairs = {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
    with pytest.raises(UsageError, match="contradict one another"):
        propagate(lambda a, b, c: a + b + c, inputs, correlations=pairs)


def test_a_formula_that_jax_cannot_follow_is_refused():
    with pytest.raises(UsageError, match="cannot be differentiated"):
        propagate(lambda a: math.sin(a), {"a": Input(1.0, 0.1)})


def test_correlated_inputs_that_are_not_normal_cannot_be_drawn():
    inputs = {"a": Input.rectangular(1.0, 0.1), "b": Input(1.0, 0.1)}
    budget = propagate(lambda a, b: a + b, inputs, correlations={("a", "b"): 0.5})
    with pytest.raises(UsageError, match="a is correlated but not normal"):
        budget.monte_carlo()


def test_too_few_draws_are_refused():
    with pytest.raises(UsageError, match=r"1000 draws are too few for intervals of 95 %: take 8000 at least"):
        propagate(lambda a: a, {"a": Input(1.0, 0.1)}).monte_carlo(1000)


def test_the_latex_table_is_one():
    text = end_gauge().to_latex()
    assert text.count(r"\\") == 8 and r"expansion\_difference" in text
    assert text.startswith(r"\begin{tabular}") and text.endswith(r"\end{tabular}")


def test_a_measured_value_keeps_its_unit():
    budget = propagate(lambda inertia: 0.73 * inertia, {"inertia": fj.Measured(8.2e-3, 4e-5, "kg m^2")}, unit="N m")
    assert budget.inputs["inertia"].unit == "kg m^2"
    assert "kg m^2" in budget.summary()
    assert Input.of(fj.Measured(1.0, 0.1)).unit == ""
