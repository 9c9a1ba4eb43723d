"""Null directions in words, from known null spaces with a mixed basis."""

import numpy as np
import pytest

from fricjax.estimation.space import Parameter
from fricjax.friction import Coulomb
from fricjax.sensitivity import fisher
from fricjax.sensitivity.directions import directions, spectrum
from tests.sensitivity.machines import prototype

pytestmark = pytest.mark.slow

VALUES = {
    "mass": (0.41, "kg"),
    "stiffness": (2574.0, "N/m"),
    "damping": (0.18, "N s/m"),
    "normal_force": (9.66, "N"),
    "mu": (0.05, ""),
    "mu_s": (0.06, ""),
    "sigma0": (1e5, "N/m"),
    "sigma2": (0.1, "N s/m"),
    "offset": (0.0, "m"),
}
PARAMETERS = [Parameter(name, unit, value, value or 1e-3) for name, (value, unit) in VALUES.items()]

SCALE = dict.fromkeys(("mass", "stiffness", "damping", "normal_force", "sigma0", "sigma2"), 1.0)
LOAD = {"normal_force": 1.0, "mu": -1.0, "mu_s": -1.0}
FLOW = {"damping": 1 / 0.18, "sigma2": -1 / 0.1}
"""In relative changes, the same force from either coefficient."""


def told(*spaces):
    rows = np.array([[space.get(name, 0.0) for name in VALUES] for space in spaces])
    mix = np.random.default_rng(1).normal(size=(len(rows), len(rows)))
    return {direction.text for direction in directions(mix @ rows, PARAMETERS)}


@pytest.mark.parametrize(
    "spaces, texts",
    [
        ([{"normal_force": 1.0, "mu": -1.0}], {"mu and normal_force only as a product"}),
        ([{"mass": 1.0, "stiffness": 1.0}], {"mass and stiffness only in ratio"}),
        ([FLOW], {"damping and sigma2 only as a sum"}),
        ([LOAD], {"mu and mu_s only as products with normal_force"}),
        ([{"mu_s": 2.0, "damping": -1.0}], {"mu_s and damping only as mu_s * damping^2"}),
        (
            [SCALE, LOAD, FLOW],
            {
                "mass, stiffness, damping, normal_force, sigma0 and sigma2 only in ratio",
                "mu and mu_s only as products with normal_force",
                "damping and sigma2 only as a sum",
            },
        ),
        (
            [{"mu": 1.0, "offset": -2.0}],
            {"mu and offset only together: -20 um of offset goes unseen with +1 % of mu"},
        ),
        ([], set()),
    ],
)
def test_words(spaces, texts):
    assert told(*spaces) == texts if spaces else directions(np.zeros((0, 9)), PARAMETERS) == ()


def test_the_spectrum_of_a_matrix_that_is_known():
    slopes = np.array([[1.0, 2.0, 0.0, 1e3], [1.0, 2.0, 0.0, -1e3], [1.0, 2.0, 0.0, 2e3]])
    found = spectrum(slopes.T @ slopes)
    assert found.active.tolist() == [True, True, False, True]
    assert found.rank == 2 and np.isinf(found.condition)
    np.testing.assert_allclose(found.null[0] / found.null[0, 0], [1, -0.5, 0, 0], atol=1e-9)
    assert spectrum(np.eye(3)).condition == pytest.approx(1.0)


def test_the_scale_and_the_load_of_a_machine():
    """Find two null directions among five coefficients.

    A trace depends only on y'' + 2 zeta omega y' + omega^2 (y + x_d sgn y') = 0.
    """
    found = fisher(prototype(Coulomb(0.05)), 1e-3)
    assert found.names == ("mass", "stiffness", "damping", "normal_force", "mu", "x0", "offset")
    assert found.rank == 5 and set(found.undetermined) == set(found.names[:5])
    assert [direction.text for direction in found.singular] == [
        "mass, stiffness, damping and normal_force only in ratio",
        "mu and normal_force only as a product",
    ]
    for direction in found.singular:
        relative = direction.changes / [found.values[name] for name in direction.names]
        np.testing.assert_allclose(np.abs(relative / relative[0]), 1.0, rtol=1e-5)
    # The kinematic quantities need no rig and are still determined.
    assert {name for name, each in found.kinematics.items() if each.std < 1e-4 * each.value} == {
        "natural_frequency",
        "damping_ratio",
        "dead_band",
        "friction_deceleration",
    }
    assert found.std_of({"mu": 1.0}) == np.inf and np.isnan(found.correlation_of("mu", "x0"))
    assert abs(found.correlation_of("x0", "offset")) < 1
    product = found.std_of({"mu": 1 / 0.05, "normal_force": 1 / 9.66, "stiffness": -1 / 2574.0})
    band = found.kinematics["dead_band"]
    assert product == pytest.approx(band.std / band.value, rel=1e-6)
    assert "mu and normal_force only as a product" in found.summary() and "<table>" in found._repr_html_()
    assert found.plot().get_axes()[0].get_xlabel() == "Standard error over size [1]"
    assert found.to_dict()["rank"] == 5
