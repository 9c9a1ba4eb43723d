"""Fits of models that are not finite.

The fault occurs at the start, midway, or only in the derivatives. Each fit must report it without a crash.
"""

import html
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import Fit, Oscillator, fit
from fricjax.errors import UsageError
from fricjax.fitting import FitError
from fricjax.friction import Coulomb
from fricjax.friction.base import Scalar, scalar
from fricjax.friction.coefficient import MU
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, coulomb_run, noisy, oscillator

pytestmark = pytest.mark.slow

RUN = coulomb_run()
START = {"mu": 0.08}
FAILS_AT_START = "not finite: the model fails at the start values. Check the law's coefficients and the engine."
STALLED = (
    "stalled: no step improves the fit although the gradient is not zero. Check bounds and the law, or use "
    "multistart() for better start values."
)


@jax.custom_jvp
def spoiled(mu, wall, rough):
    """Return `mu`, or NaN below `wall`.

    Below `rough`, only the derivative is NaN.
    """
    return jnp.where(mu < wall, jnp.nan, mu)


@spoiled.defjvp
def _spoiled_jvp(primals, tangents):
    mu, wall, rough = primals
    return spoiled(mu, wall, rough), jnp.where((mu < wall) | (mu < rough), jnp.nan, tangents[0])


class Faulty(Coulomb):
    """Coulomb friction that fails for small coefficients.

    The exact engine treats it as a Coulomb law.
    """

    wall: Scalar = eqx.field(converter=scalar, default=0.0)
    rough: Scalar = eqx.field(converter=scalar, default=0.0)
    coefficients: ClassVar = {**Coulomb.coefficients, "wall": MU, "rough": MU}

    def dynamic_force(self, load):
        return spoiled(self.mu, self.wall, self.rough) * load


def fitted(wall: float = 0.0, rough: float = 0.0, **options: Any) -> Fit:
    law = Faulty(0.05, None, wall, rough)
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, law)
    return fit(RUN, machine, MACHINE, **{"throw": False, "guess": START, **options})


def assert_failed(found: Fit, status: str):
    assert found.status == status
    assert not found.described
    assert found.status in found.summary() and html.escape(found.status) in found._repr_html_()
    assert "nan" not in found.summary()
    assert set(found.std_errors) == set(found.values) == set(found.names)


def test_without_a_fault_it_converges():
    found = fitted()
    assert found.converged and found.status == "described"
    assert abs(found.values["mu"] - 0.05) < 4 * found.std_errors["mu"]


@pytest.mark.parametrize("fault", [{"wall": 1.0}, {"guess": {"damping": 1e5}}], ids=["a law", "overdamped"])
def test_nan_at_the_start(fault):
    found = fitted(**fault)
    assert_failed(found, FAILS_AT_START)
    assert all(std == np.inf for std in found.std_errors.values())
    assert np.isnan(found.numerical_shift)
    assert "at start value" in found.flags["mu"]
    with pytest.raises(FitError, match="The fit is not valid, not finite: the model fails at the start values"):
        fitted(**fault, throw=True)


def test_nan_between_start_and_optimum():
    """Stop at the wall with finite numbers and without convergence."""
    found = fitted(wall=0.06)
    assert_failed(found, STALLED)
    assert 0.06 <= found.values["mu"] < 0.08
    assert np.all(np.isfinite(list(found.values.values())))


def test_nan_just_behind_the_optimum_does_no_harm():
    """Reject trial steps behind the wall like steps that raise chi^2."""
    plain, found = fitted(), fitted(wall=0.05 - 1e-6)
    assert found.status == "described"
    assert found.values["mu"] == pytest.approx(plain.values["mu"], abs=1e-3 * plain.std_errors["mu"])
    assert found.std_errors["mu"] == pytest.approx(plain.std_errors["mu"], rel=1e-6)


def test_nan_in_the_derivatives_alone_at_the_start():
    assert_failed(fitted(rough=1.0), FAILS_AT_START)


def test_nan_in_the_derivatives_alone_midway():
    found = fitted(rough=0.06)
    assert_failed(found, STALLED)
    assert 0.06 <= found.values["mu"] < 0.08


def test_an_optimum_behind_a_wall_of_bounds_is_at_the_bound():
    """Pass the wall as a bound, so that the model stays finite."""
    found = fitted(wall=0.06, bounds={"mu": (0.06, None)})
    assert found.optimum_found and not found.described
    # A trial without the bound runs into the wall.
    assert found.status.startswith("does not describe: no cause found")
    assert found.values["mu"] == 0.06


def test_the_hybrid_engine_at_a_start_without_half_cycles():
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.02) + Coulomb(0.03))
    free, tie = ("friction.0.mu", "damping", "stiffness"), {"friction.1.mu": ("friction.0.mu", 0.5)}
    assert_failed(fit(RUN, machine, free, tie=tie, guess={"damping": 1e5}, throw=False), FAILS_AT_START)


def test_the_smooth_engine_at_a_start_that_grows_without_bound():
    run, machine = noisy("sliding", "LuGre", 0), oscillator(RIGS["sliding"], "LuGre")
    found = fit(run, machine, (*MACHINE, "sigma0"), guess={"damping": -1e7}, throw=False)
    assert_failed(found, FAILS_AT_START)


@pytest.mark.parametrize("value", [np.nan, np.inf, -2574.0])
def test_a_start_value_that_cannot_be_is_refused(value):
    """Refuse a stiffness without a logarithm, which the fit uses."""
    with pytest.raises(UsageError, match=r"The start value of stiffness must be .*, got"):
        fitted(guess={"stiffness": value})
