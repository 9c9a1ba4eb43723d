"""Columns and axes of an archive have the right units."""

import pandas as pd
import pytest

import fricjax as fj
from fricjax.archive.show import parameter_figure, unit_of


def test_units_are_those_of_the_law_and_of_the_rig():
    assert unit_of("x0[2]", []) == "m"
    assert unit_of("x0", [], "rad") == "rad"
    assert unit_of("stiffness", [], "rad") == "N m/rad"
    assert unit_of("v_stribeck", ["stribeck"]) == "m/s"
    assert (
        unit_of("friction.1.quadratic_drag", ["coulomb+quadraticdrag"])
        == fj.friction.QuadraticDrag.coefficients["quadratic_drag"].unit
    )
    assert unit_of("lubricant", ["coulomb"]) == ""


@pytest.mark.parametrize("quantity, load, damping", [("m", "N", "N s/m"), ("rad", "N m", "N m s/rad")])
def test_axes_name_their_units(quantity, load, damping):
    # A rejected run has no quantity.
    table = pd.DataFrame(
        {
            "friction": "coulomb",
            "status": ["rejected", "ok", "ok"],
            "quantity": [None, quantity, quantity],
            "load": [4.0, 8.0, 12.0],
            "damping": [float("nan"), 0.2, 0.3],
            "damping_combined_std": [float("nan"), 0.01, 0.01],
        }
    )
    axes = parameter_figure(table, "damping", "load").axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (f"Load [{load}]", f"damping [{damping}]")
    assert parameter_figure(table, "damping", "run").axes[0].get_xlabel() == "Run"
