"""Moving mass from two frequencies: closed form and uncertainty."""

import math

import numpy as np
import pytest

from fricjax.calibrate.ringdown import calibrate_added_mass
from fricjax.errors import UsageError
from fricjax.rig import Measured

MASS, STIFFNESS, ADDED = 0.41068, 2574.0, 0.1


def frequency(mass):
    return math.sqrt(STIFFNESS / mass) / (2 * math.pi)


def test_mass_comes_back_from_the_frequencies_of_one_spring():
    found = calibrate_added_mass(frequency(MASS), frequency(MASS + ADDED), ADDED)
    assert found.value == pytest.approx(MASS, rel=1e-13)
    assert found.std == 0.0


def test_uncertainty_is_that_of_repeated_measurements():
    stated = [(frequency(MASS), 2e-6), (frequency(MASS + ADDED), 2e-6), (ADDED, 1e-5)]
    inputs = [Measured(value, value * relative) for value, relative in stated]
    generator = np.random.default_rng(0)
    f1, f2, dm = (number.value + number.std * generator.standard_normal(200_000) for number in inputs)
    repeated = dm / (f1**2 / f2**2 - 1)
    found = calibrate_added_mass(*inputs)
    assert found.std == pytest.approx(np.std(repeated), rel=0.01)
    # 100 g to 1e-5 and frequencies to 2e-6 give the mass to 3e-5.
    assert found.relative == pytest.approx(3e-5, rel=0.15)


def test_texts_with_units():
    found = calibrate_added_mass("12.6000(2) Hz", "11.3000(2) Hz", "100.000(1) g")
    assert found.value == pytest.approx(0.1 / (12.6**2 / 11.3**2 - 1), rel=1e-12)
    assert found.std > 0


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ((11.3, 12.6, 0.1), "frequency_loaded must be lower than frequency, for mass slows a spring down; got 12.6 Hz"),
        ((12.6, 11.3, -0.1), "added_mass must be a positive number of kg, got -0.1."),
        ((0.0, 11.3, 0.1), "frequency must be a positive number of Hz, got 0."),
        ((12.6, "11.3 kg", 0.1), "The unit 'kg' does not fit frequency"),
    ],
)
def test_refusals_by_their_text(given, sentence):
    with pytest.raises(UsageError) as caught:
        calibrate_added_mass(*given)
    assert str(caught.value).startswith(sentence)
