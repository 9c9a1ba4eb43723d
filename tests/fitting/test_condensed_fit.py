"""Fits of condensed records against fits of all samples, also by SciPy."""

from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from fricjax import Fit, Oscillator, Trace, fit
from fricjax.estimation.passes import residual_and_jacobian
from fricjax.fitting import problem
from fricjax.friction import Coulomb
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS, coulomb_run

OSCILLATOR = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.05))


def values_of(found: Fit) -> np.ndarray:
    return np.array([found.values[name] for name in found.names])


whole = eqx.filter_jit(residual_and_jacobian)


def dense(residual) -> tuple[np.ndarray, np.ndarray]:
    """Values and covariance of a least-squares fit by SciPy, to rounding."""

    def model(part):
        return lambda y: np.asarray(whole(residual, jnp.asarray(y))[part])

    start, jacobian = np.zeros(residual.n_parameters), cast(Any, model(1))
    solution = least_squares(model(0), start, jacobian, method="lm", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    y, unit = solution.x, np.linalg.norm(solution.jac, axis=0)
    for _ in range(2):  # MINPACK stops at the rounding of chi^2, 1e-6 to 1e-5 standard errors from the optimum
        y = y - np.linalg.lstsq(model(1)(y) / unit, model(0)(y), rcond=None)[0] / unit
    slope, steep = np.asarray(residual.space.slope(jnp.asarray(y))), model(1)(y) / unit
    inverse = np.linalg.inv(steep.T @ steep) / np.outer(unit, unit)
    return np.asarray(residual.values(jnp.asarray(y))), slope[:, None] * inverse * slope


RUN = coulomb_run()


def masked(run: Trace) -> Trace:
    mask = np.random.default_rng(2).uniform(size=run.n) < 0.8
    return Trace(run.t, np.where(mask, run.x, 1.0), sigma=run.sigma, mask=mask)


def weighted(run: Trace) -> Trace:
    """Double the noise of the second half of the record."""
    sigma = np.where(np.arange(run.n) < run.n // 2, 1e-9, 2e-9)
    return Trace(run.t, run.x + 1.7e-9 * np.random.default_rng(3).standard_normal(run.n) * (sigma > 1.5e-9), sigma)


RUNS = {"plain": RUN, "masked": masked(RUN), "weighted": weighted(RUN), "in motion": coulomb_run(mu=0.005)}


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS.keys())
def test_estimate_and_covariance_are_those_of_all_samples(run):
    posing = problem_of(run, OSCILLATOR, MACHINE)
    assert np.sum(posing.condensed.runs[0].weight > 0) < 0.5 * posing.n_used
    few, every = (dense(residual) for residual in (posing.condensed, posing.residual))
    std = np.sqrt(np.diag(every[1]))
    print(f"\ncondensed samples move the optimum by {np.max(np.abs(few[0] - every[0]) / std):.1e} standard errors")
    assert few[0] / std == pytest.approx(every[0] / std, rel=1e-9, abs=1e-6)
    assert few[1] / np.outer(std, std) == pytest.approx(every[1] / np.outer(std, std), abs=1e-9)
    # An engine by name selects the general way.
    found = fit(run, OSCILLATOR, MACHINE, engine="exact")
    shown = values_of(found) - [found.origins[0] * (name == "t_release") for name in found.names]
    assert np.max(np.abs(shown - every[0]) / std) < 1e-3  # the fit stops at a thousandth of a standard error
    assert found.covariance / np.outer(std, std) == pytest.approx(every[1] / np.outer(std, std), abs=1e-8)


@pytest.mark.slow
def test_a_record_of_high_rate_gives_the_same_with_and_without_condensation(monkeypatch):
    run = coulomb_run(samples=300_000, rate=7.5e5)
    found = fit(run, OSCILLATOR, MACHINE)
    assert np.sum(problem_of(run, OSCILLATOR, MACHINE).condensed.runs[0].weight > 0) < 10_000
    monkeypatch.setattr(problem, "condensed_run", lambda window, run, oscillator: run)
    assert problem_of(run, OSCILLATOR, MACHINE).condensed.runs[0].t.size >= 2.5e5
    every = fit(run, OSCILLATOR, MACHINE)
    std = np.sqrt(np.diag(every.covariance))
    shift = np.max(np.abs(values_of(found) - values_of(every)) / std)
    print(f"\n3e5 samples: condensation moves the optimum by {shift:.1e} standard errors")
    assert shift < 1e-3 and found.numerical_shift < 1e-3
    assert found.covariance / np.outer(std, std) == pytest.approx(every.covariance / np.outer(std, std), abs=1e-8)
    assert found.chi2 == pytest.approx(every.chi2, abs=1e-3)
    assert found.status == every.status == "described"
