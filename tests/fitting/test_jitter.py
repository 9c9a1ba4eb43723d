"""The residual is smooth in the parameters: chi^2 along mu is a curve without jitter, and its derivative is its slope."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from fricjax.fitting.mesh import with_mesh
from fricjax.fitting.problem import Problem
from fricjax.fitting.solve import solve
from tests.fitting.posed import posed
from tests.fitting.runs import MACHINE, RIGS, noisy, oscillator

ENGINES = {"Coulomb": "Exact", "Tanh": "Hybrid", "LuGre": "Smooth"}
REACH, POINTS = 1e-4, 201


class Curves(NamedTuple):
    """chi^2 and its derivative with respect to mu at mu (1 + `relative`), shapes (201,) and (201, 2).

    The first column belongs to the condensed record, the second to all samples.
    """

    mu: float
    relative: np.ndarray
    chi2: np.ndarray
    slope: np.ndarray


@eqx.filter_jit
def along_mu(few, every, y, slope, relative):
    """The scan, mapped one point after the other; mu is the first parameter, and linear in its coordinate."""
    mu = every.values(y)[0]

    def chi2(at):
        there = y.at[0].add((at - mu) / slope)
        residuals = few(there), every(there)
        return jnp.stack([r @ r for r in residuals])

    return jax.lax.map(lambda at: jax.jvp(chi2, (at,), (jnp.ones(()),)), mu * (1 + relative))


def scan(problem: Problem) -> Curves:
    p = problem.residual.n_parameters
    y = jnp.asarray(solve(problem).y[:p])
    few, every = (with_mesh(residual, y) for residual in (problem.condensed, problem.residual))
    relative = np.linspace(-REACH, REACH, POINTS)
    chi2, slope = along_mu(few, every, y, problem.residual.space.slope(y)[0], jnp.asarray(relative))
    return Curves(float(problem.residual.values(y)[0]), relative, np.asarray(chi2), np.asarray(slope))


@pytest.fixture(params=ENGINES, scope="module")
def curves(request) -> Curves:
    law = request.param
    free = (*MACHINE, "sigma0") if law == "LuGre" else MACHINE
    problem = posed(noisy("rolling", law, 0), oscillator(RIGS["rolling"], law), free)
    assert type(problem.residual.engine).__name__ == ENGINES[law]
    return scan(problem)


def deviation(curves: Curves, degree: int) -> np.ndarray:
    """Largest distance of chi^2 from its least-squares polynomial, for condensed and for all samples."""
    u = curves.relative / REACH
    return np.array([np.max(np.abs(Chebyshev.fit(u, chi2, degree)(u) - chi2)) for chi2 in curves.chi2.T])


def test_the_scan_reaches_far_beyond_the_standard_error(curves):
    assert np.all(np.ptp(curves.chi2, axis=0) > 1e5)


# Sums over 10^4 samples 35 standard errors from the optimum: rounding of the motion alone makes up some 1e-4. chi^2
# of Coulomb and Tanh is a parabola in mu to that level; that of LuGre has a true cubic part of 3e-2, in 3e5.
def test_jitter_of_chi2_about_a_smooth_curve_is_below_a_thousandth(curves):
    parabola, quartic = deviation(curves, 2), deviation(curves, 4)
    print(f"\nlargest deviation of chi^2 (condensed, all) from a parabola {parabola}, from a quartic {quartic}")
    assert np.all(quartic <= 1e-3)
    assert np.all(parabola <= 1e-6 * np.ptp(curves.chi2, axis=0))


def test_the_derivative_is_the_slope(curves):
    mu = curves.mu * (1 + curves.relative)
    differences = (curves.chi2[2:] - curves.chi2[:-2]) / (mu[2:] - mu[:-2])[:, None]
    error = np.abs(curves.slope[1:-1] - differences) / np.max(np.abs(curves.slope), axis=0)
    print(f"\nlargest error of the derivative relative to the largest slope: {error.max():.1e}")
    assert error.max() < 1e-6
    # Also point by point, wherever chi^2 changes at all.
    steep = np.abs(curves.relative[1:-1]) > 0.05 * REACH
    assert np.max(np.abs(curves.slope[1:-1] / differences - 1)[steep]) < 1e-4


def test_condensed_and_all_samples_differ_by_a_constant(curves):
    apart = curves.chi2[:, 1] - curves.chi2[:, 0]
    assert np.ptp(apart) < 1e-3
