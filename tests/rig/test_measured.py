"""Calibrated numbers: accepted values, text and units."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fricjax.errors import UsageError
from fricjax.rig import Measured
from fricjax.rig.quantity import quantity
from fricjax.show import plain_data


def test_repr_is_the_shorthand_of_the_field():
    assert repr(Measured(0.4107, 0.0012)) == "0.4107(12)"
    assert repr(Measured(9.66)) == "9.66"
    assert repr(Measured(12.6, 0.002, "Hz")) == "12.6000(20) Hz"


def test_what_is_not_determined_says_so():
    assert repr(Measured(0.01, float("inf"), "N")) == "0.0100 N (undetermined)"
    assert not Measured(0.01, float("inf")).is_finite and Measured(0.01, 0.1).is_finite


def test_as_plain_data_the_unit_stands_where_it_is_said():
    assert plain_data(Measured(1.0, 0.1, "")) == {"value": 1.0, "std": 0.1, "unit": ""}
    assert plain_data(Measured(1.0, 0.1)) == {"value": 1.0, "std": 0.1}


def test_relative_uncertainty():
    assert Measured(-2.0, 0.01).relative == pytest.approx(0.005)
    assert Measured(0.0, 0.1).relative == float("inf")
    assert Measured(0.0).relative == 0.0


@pytest.mark.parametrize(
    ("value", "std", "sentence"),
    [
        (1.0, -0.1, "The standard uncertainty of a Measured must not be negative, got -0.1."),
        ("1", 0.0, "The value of a Measured must be one number, got '1'."),
        ([1.0, 2.0], 0.0, "The value of a Measured must be one number, got [1.0, 2.0]."),
        (True, 0.0, "The value of a Measured must be one number, got True."),
    ],
)
def test_refusals_by_their_text(value, std, sentence):
    with pytest.raises(UsageError) as caught:
        Measured(value, std)
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    ("name", "written", "value", "std"),
    [
        ("mass", "410.7(3) g", 0.4107, 0.0003),
        ("mass", "410.7(12)", 410.7, 1.2),
        ("mass", "3.33(2)e-3 kg m^2", 3.33e-3, 2e-5),
        ("normal_force", "9.66 +/- 0.5 % N", 9.66, 0.0483),
        ("normal_force", "9.66 ± 0.05 N", 9.66, 0.05),
        ("stiffness", "2.574 N/mm", 2574.0, 0.0),
        ("stiffness", {"value": 0.2, "std": "1 %", "unit": "N m/rad"}, 0.2, 0.002),
        ("frequency", "756 1/min", 12.6, 0.0),
        ("damping_ratio", "0.27 %", 0.0027, 0.0),
        ("k3", "5 N/mm^3", 5e9, 0.0),
        ("drag", 0.5, 0.5, 0.0),
        ("mass", Measured(2.0, 0.1), 2.0, 0.1),
        ("frequency", Measured(12.6, 1e-5, "Hz"), 12.6, 1e-5),
        ("mass", Measured(410.7, 0.3, "g"), 0.4107, 0.0003),
    ],
)
def test_written_quantities_are_converted_to_si(name, written, value, std):
    got = quantity(name, written)
    assert got.value == pytest.approx(value, rel=1e-12)
    assert got.std == pytest.approx(std, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "written", "sentence"),
    [
        ("mass", "3 N", "The unit 'N' does not fit mass; use for example 'kg' (rotary rigs: 'kg m^2')."),
        ("mass", "3 kgs", "mass has the unknown unit 'kgs'; use for example 'kg' (rotary rigs: 'kg m^2')."),
        ("damping_ratio", "1 N", "The unit 'N' does not fit damping_ratio; use for example '%'."),
        ("frequency", "79 rad/s", "frequency counts cycles: give it in Hz, not in 'rad/s' (1 Hz is 2 pi rad/s)."),
        (
            "mass",
            {"value": 1.0, "sdt": 0.1},
            "mass has no entry 'sdt'; known are value, std, unit. Did you mean 'std'?",
        ),
        ("mass", {"std": 0.1}, "mass = {'std': 0.1} has no value; write mass = { value = ..., std = ... }."),
        ("mass", {"value": "1"}, "The value of mass must be a number, got '1'."),
        (
            "mass",
            {"value": 1.0, "std": -1},
            "mass: The standard uncertainty of a Measured must not be negative, got -1.",
        ),
        ("mass", float("inf"), "mass must be a finite number of kg, got inf."),
        ("mass", None, "mass must be a finite number of kg, got None."),
        ("mass", Measured(float("nan")), "mass must be a finite number of kg, got nan."),
        ("mass", Measured(1.0, float("inf")), "mass must be a finite number of kg, got 1.00 (undetermined)."),
        (
            "mass",
            Measured(12.6, 1e-5, "Hz"),
            "The unit 'Hz' does not fit mass; use for example 'kg' (rotary rigs: 'kg m^2').",
        ),
    ],
)
def test_quantities_refused_by_their_text(name, written, sentence):
    with pytest.raises(UsageError) as caught:
        quantity(name, written)
    assert str(caught.value) == sentence


def test_text_that_is_no_quantity_shows_how_to_write_one():
    with pytest.raises(UsageError, match=r'mass = "heavy" is no quantity; .* such as "410.7\(3\) g"'):
        quantity("mass", "heavy")


@given(value=st.floats(1e-6, 1e6), std=st.floats(1e-6, 1e3))
def test_plus_minus_text_round_trips(value, std):
    got = quantity("stiffness", f"{value!r} +/- {std!r} N/m")
    assert (got.value, got.std) == (value, std)
