"""Numbers as text, read back also by an independent library."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from uncertainties import ufloat_fromstr

from fricjax.show import display_unit, duration, engineering, interval, parse_uncertain, plain, rotary_unit, uncertain


@pytest.mark.parametrize(
    ("value", "std", "unit", "text"),
    [
        (0.214523, 0.000312, "", "0.21452(31)"),
        (0.0100, 0.0, "", "0.0100 (fixed)"),
        (0.0100, None, "", "0.0100 (fixed)"),
        (0.0100, math.inf, "", "0.0100 (undetermined)"),
        (0.0100, math.nan, "N", "0.0100 N (undetermined)"),
        (math.nan, 0.1, "", "undetermined"),
        (120.34, 1.23, "N/m", "120.3(1.2) N/m"),
        (-120.34, 12.3, "", "-120(12)"),
        (0.5, 0.0996, "", "0.50(10)"),
        (0.5, 0.996, "", "0.5(1.0)"),
        (0.5, 0.963, "", "0.50(96)"),
        (1.0021e-5, 3.4e-7, "m/s", "1.002(34)e-05 m/s"),
        (123456.0, 1234.0, "", "1.235(12)e+05"),
        (0.0, 2.5e-9, "m", "0.0(2.5)e-09 m"),
        (3.0, 250.0, "", "0.0(2.5)e+02"),
        (0.00001, 0.02, "", "0.000(20)"),
    ],
)
def test_uncertain_examples(value, std, unit, text):
    assert uncertain(value, std, unit) == text


magnitudes = st.floats(-12, 8).map(lambda power: 10.0**power)


@given(value=st.one_of(st.just(0.0), magnitudes), sign=st.sampled_from([-1, 1]), std=magnitudes)
def test_uncertain_reads_back_within_half_a_unit_of_the_last_digit(value, sign, std):
    read = ufloat_fromstr(uncertain(sign * value, std))
    half = 0.5 * 10.0 ** (int(f"{std:.1e}".split("e")[1]) - 1) * (1 + 1e-6)
    assert abs(read.nominal_value - sign * value) <= half + 1e-15 * value
    assert abs(read.std_dev - std) <= half


@given(value=st.one_of(st.just(0.0), magnitudes), sign=st.sampled_from([-1, 1]), std=magnitudes)
def test_the_shorthand_is_read_as_an_independent_library_reads_it(value, sign, std):
    text = uncertain(sign * value, std)
    read, expected = parse_uncertain(f"{text} N/m"), ufloat_fromstr(text)
    assert read is not None
    assert read[:2] == pytest.approx((expected.nominal_value, expected.std_dev), rel=1e-14)
    assert read[2] == "N/m"


def test_negative_uncertainty_is_refused():
    with pytest.raises(ValueError, match=r"cannot be negative, got -0\.1"):
        uncertain(1.0, -0.1)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.01, "0.0100"),
        (0.214523, "0.214523"),
        (1e-5, "1.00e-05"),
        (1234567.0, "1.23457e+06"),
        (0.0, "0"),
        (120, "120"),
    ],
)
def test_plain(value, text):
    assert plain(value) == text


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_plain_keeps_six_digits(value):
    assert float(plain(value)) == pytest.approx(value, rel=5.1e-6, abs=5e-324)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (12.3e-6, "m", "12.3 um"),
        (5e-9, "m", "5 nm"),
        (-2.0e-3, "m", "-2 mm"),
        (999.96e-6, "m", "1 mm"),
        (1500.0, "N/m", "1.5 kN/m"),
        (1000.0, "s", "1 ks"),
        (0.25, "kg", "250 g"),
        (2.5, "kg", "2.5 kg"),
        (1e-3, "m^2", "0.001 m^2"),
        (1e-3, "1/s", "0.001 1/s"),
        (0.5, "", "0.5"),
        (0.0, "m", "0 m"),
        (math.inf, "m", "inf m"),
    ],
)
def test_engineering(value, unit, text):
    assert engineering(value, unit) == text


@pytest.mark.slow
@given(value=magnitudes, unit=st.sampled_from(["m", "s", "N", "rad"]))
def test_engineering_keeps_three_digits(value, unit):
    from pint import UnitRegistry

    number, shown = engineering(value, unit).split()
    factor = float(_REGISTRY.setdefault(0, UnitRegistry()).Quantity(1, shown).to(unit).magnitude)
    assert float(number) * factor == pytest.approx(value, rel=5.1e-3)


_REGISTRY: dict = {}


def test_interval_tells_the_ends_apart():
    assert interval(0.21014, 0.21344) == "[0.2101, 0.2134]"
    low, high = interval(1.0, 1.0 + 1e-9)[1:-1].split(", ")
    assert float(low) < float(high)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.2e-3, "3.2 ms"), (4.7, "4.7 s"), (59.99, "1 min 00 s"), (125.0, "2 min 05 s"), (3780.0, "1 h 03 min")],
)
def test_duration(seconds, text):
    assert duration(seconds) == text


def test_a_value_that_is_known_beyond_all_digits_is_shown():
    assert uncertain(1e40, 1e-3) == "10000000000000000000000000000000000000000.0000(10)"
    assert uncertain(1e308, 5e-324).endswith("(50)")


def test_a_rotary_rig_has_torques_for_forces():
    assert [rotary_unit(unit, "rad") for unit in ("m", "N", "kg", "Hz", "")] == ["rad", "N m", "kg m^2", "Hz", ""]
    assert rotary_unit("N s^2/m^2", "m") == "N s^2/m^2"
    assert display_unit(2e-3, "rad") == (1e3, "mrad")
