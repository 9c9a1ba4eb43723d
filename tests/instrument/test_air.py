"""Refractive index of air against published values and another equation."""

import math

import pytest

from fricjax.errors import UsageError
from fricjax.instrument import refractive_index

# P. E. Ciddor, Applied Optics 35 (1996), dry air at 633 nm with 450 ppm: degC, Pa, 10^8 (n - 1).
PAPER = [(20, 80e3, 21458.0), (20, 100e3, 26824.4), (20, 120e3, 32191.6), (10, 100e3, 27774.7), (30, 100e3, 25937.2)]
# NIST's Engineering Metrology Toolbox, Ciddor's equation at 633 nm: degC, Pa, relative humidity, n.
NIST = [
    (20, 101325, 0, 1.000271800),
    (20, 60000, 0, 1.000160924),
    (20, 120000, 0, 1.000321916),
    (50, 100000, 0, 1.000243285),
    (5, 100000, 0, 1.000282756),
    (-40, 100000, 0, 1.000337580),
    (50, 120000, 1, 1.000287924),
    (20, 100000, 1, 1.000267394),
]


@pytest.mark.parametrize(("temperature", "pressure", "expected"), PAPER)
def test_dry_air_of_the_paper(temperature, pressure, expected):
    index = refractive_index(633e-9, temperature=temperature, pressure=pressure, humidity=0)
    assert 1e8 * (index - 1) == pytest.approx(expected, abs=0.051)


@pytest.mark.parametrize(("temperature", "pressure", "humidity", "expected"), NIST)
def test_the_values_of_nist(temperature, pressure, humidity, expected):
    index = refractive_index(633e-9, temperature=temperature, pressure=pressure, humidity=humidity)
    assert index == pytest.approx(expected, abs=0.51e-9)


def edlen(wavelength, celsius, pressure, vapour):
    """Updated Edlen equation.

    Birch and Downs, Metrologia 30 (1993) 155 and 31 (1994) 315.
    """
    s = (1e-6 / wavelength) ** 2
    standard = 1e-8 * (8342.54 + 2406147 / (130 - s) + 15998 / (38.9 - s))
    dense = (1 + 1e-8 * (0.601 - 0.00972 * celsius) * pressure) / (1 + 0.0036610 * celsius)
    return 1 + pressure * standard / 96095.43 * dense - 1e-10 * vapour * (3.7345 - 0.0401 * s)


@pytest.mark.parametrize("wavelength", [543.5e-9, 632.9908e-9, 780.2e-9])
@pytest.mark.parametrize("celsius", [15, 20, 25])
@pytest.mark.parametrize("humidity", [0.0, 0.6])
def test_the_other_equation_agrees_in_a_laboratory(wavelength, celsius, humidity):
    # Magnus' formula, with an error of 0.1 % of the vapour pressure.
    vapour = humidity * 611.2 * math.exp(17.62 * celsius / (243.12 + celsius))
    for pressure in (90e3, 101325, 105e3):
        ours = refractive_index(wavelength, temperature=celsius, pressure=pressure, humidity=humidity)
        assert ours == pytest.approx(edlen(wavelength, celsius, pressure, vapour), abs=2e-8)


def test_carbon_dioxide_adds_its_share():
    low, high = (refractive_index(co2=co2, humidity=0) for co2 in (350e-6, 450e-6))
    # Edlen (1966): the refractivity grows by 0.540 of the mole fraction.
    assert (high - low) / (high - 1) == pytest.approx(0.54 * 100e-6, rel=0.02)


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"humidity": 45}, "humidity must lie between 0 and 1 for Ciddor's equation, got 45"),
        ({"temperature": 293.15}, "temperature must lie between -40 and 100 degC"),
        ({"pressure": 1013.25}, "pressure must lie between 10000 and 140000 Pa"),
        ({"wavelength": 633}, "wavelength must lie between"),
        ({"co2": "much"}, "co2 must be one number"),
    ],
)
def test_values_for_which_it_does_not_hold(inputs, message):
    with pytest.raises(UsageError, match=message):
        refractive_index(**inputs)
