"""Smoothness of chi^2 along mu, and its derivative against its slope."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from fricjax.fitting.mesh import with_mesh
from fricjax.fitting.problem import Problem
from fricjax.fitting.residual import Residual
from fricjax.fitting.solve import solve
from tests.fitting.problem_of import problem_of
from tests.machines import MACHINE, RIGS, noisy, oscillator

pytestmark = pytest.mark.slow

ENGINES = {"Coulomb": "Exact", "Tanh": "Hybrid", "LuGre": "Smooth"}
REACH, POINTS = 1e-4, 201


class Curves(NamedTuple):
    """chi^2 and its derivative in mu at mu (1 + `relative`).

    `relative` has shape (201,), the curves (201, 2). The first column belongs to the condensed record,
    the second to all samples.
    """

    law: str
    mu: float
    relative: np.ndarray
    chi2: np.ndarray
    slope: np.ndarray


@eqx.filter_jit
def along_mu(residual, few, y, slope, relative):
    """chi^2 of the residuals in `few` and of the others.

    The parameter mu is the first one, and linear in its coordinate.
    """
    mu = residual.values(y)[0]

    def chi2(at):
        r = residual(y.at[0].add((at - mu) / slope))
        return jnp.stack([jnp.sum(jnp.where(few, r**2, 0.0)), jnp.sum(jnp.where(few, 0.0, r**2))])

    return jax.lax.map(lambda at: jax.jvp(chi2, (at,), (jnp.ones(()),)), mu * (1 + relative))


def joined(problem: Problem) -> tuple[Residual, np.ndarray]:
    """Join the residuals of the condensed record and of all samples.

    Return the joint residual and a mask of the condensed samples.
    """
    columns = [(run.t, run.x, run.weight) for run in (problem.condensed.runs[0], problem.residual.runs[0])]
    both = [np.concatenate(pair) for pair in zip(*columns, strict=True)]
    residual = eqx.tree_at(lambda r: (r.runs[0].t, r.runs[0].x, r.runs[0].weight), problem.condensed, both)
    return residual, np.arange(both[0].size + residual.n_parameters) < columns[0][0].size


def scan(law: str, problem: Problem) -> Curves:
    residual, few = joined(problem)
    y = jnp.asarray(solve(problem).y[: residual.n_parameters])
    relative = np.linspace(-REACH, REACH, POINTS)
    found = along_mu(with_mesh(residual, y), few, y, residual.space.slope(y)[0], jnp.asarray(relative))
    return Curves(law, float(residual.values(y)[0]), relative, *map(np.asarray, found))


@pytest.fixture(params=ENGINES, scope="module")
def curves(request) -> Curves:
    law = request.param
    free = (*MACHINE, "sigma0") if law == "LuGre" else MACHINE
    problem = problem_of(noisy("rolling", law, 0), oscillator(RIGS["rolling"], law), free, engine=ENGINES[law].lower())
    assert type(problem.residual.engine).__name__ == ENGINES[law]
    return scan(law, problem)


def deviation(curves: Curves, degree: int) -> np.ndarray:
    """Distance of chi^2 from its least-squares polynomial, with shape (201, 2).

    The columns are those of `Curves`.
    """
    u = curves.relative / REACH
    return np.stack([Chebyshev.fit(u, chi2, degree)(u) - chi2 for chi2 in curves.chi2.T], axis=1)


def test_the_scan_reaches_far_beyond_the_standard_error(curves):
    assert np.all(np.ptp(curves.chi2, axis=0) > 1e5)


# The ends of the scan are 500 standard errors of mu alone from the optimum, with chi^2 = 3e5. There, 5e-17 m of
# rounding in the motion change chi^2 by 1e-3, as do 7000 steps of the smooth engine. LuGre has a true cubic of 3e-2.
LARGEST = {"Coulomb": 1e-4, "Tanh": 1e-3, "LuGre": 3e-3}
TRUE_DEGREE = {"Coulomb": 2, "Tanh": 2, "LuGre": 4}


def test_jitter_of_chi2_about_a_smooth_curve_is_below_a_thousandth(curves):
    parabola, quartic = deviation(curves, 2), deviation(curves, 4)
    for name, found in (("parabola", parabola), ("quartic", quartic)):
        print(f"\n{curves.law}, deviation of chi^2 from a {name}: {np.max(np.abs(found)):.1e}, rms {found.std():.1e}")
    jitter = deviation(curves, TRUE_DEGREE[curves.law])
    assert np.all(np.std(jitter, axis=0) <= 1e-3)
    assert np.max(np.abs(jitter)) <= LARGEST[curves.law]
    assert np.max(np.abs(parabola)) <= 1e-6 * np.max(np.ptp(curves.chi2, axis=0))


def test_the_derivative_is_the_slope(curves):
    mu = curves.mu * (1 + curves.relative)
    differences = (curves.chi2[2:] - curves.chi2[:-2]) / (mu[2:] - mu[:-2])[:, None]
    error = np.abs(curves.slope[1:-1] - differences) / np.max(np.abs(curves.slope), axis=0)
    print(f"\nlargest error of the derivative relative to the largest slope: {error.max():.1e}")
    assert error.max() < 1e-6
    # Also point by point, except near the optimum, where chi^2 hardly changes.
    steep = np.abs(curves.relative[1:-1]) > 0.05 * REACH
    assert np.max(np.abs(curves.slope[1:-1] / differences - 1)[steep]) < 1e-4


def test_condensed_samples_have_their_minimum_where_all_samples_have_it(curves):
    """Compare the optima by the slope of the difference in chi^2.

    The optimum moves by half of this slope over the curvature.
    """
    away = np.sqrt(np.ptp(curves.chi2[:, 1]))  # the ends of the scan in standard errors of mu alone
    slope = np.ptp(curves.chi2[:, 1] - curves.chi2[:, 0]) / (2 * away)
    print(f"\n{curves.law}: condensed samples move mu alone by {slope / 2:.1e} of its standard error")
    assert slope / 2 < 0.02
