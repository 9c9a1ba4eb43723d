"""Mean and scatter over runs: against campaigns whose scatter is known, and against the likelihood on a grid."""

import numpy as np
import pytest
from scipy.stats import norm

import fricjax as fj
from fricjax.data.errors import DataError, UsageError
from fricjax.fitting.population import population
from tests.fitting.runs import RIGS, coulomb_run, oscillator


def runs(seed: int, n: int = 20, scatter: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    u = random.uniform(1e-4, 2e-3, n)
    return 0.05 + scatter * random.standard_normal(n) + u * random.standard_normal(n), u


def test_intervals_cover_as_they_say():
    found = [population(*runs(seed)) for seed in range(400)]
    mean = np.mean([p.interval[0] <= 0.05 <= p.interval[1] for p in found])
    scatter = np.mean([p.scatter_interval[0] <= 1e-3 <= p.scatter_interval[1] for p in found])
    assert 0.92 <= mean <= 0.98
    assert 0.92 <= scatter <= 0.98
    assert np.mean([p.scatter**2 for p in found]) == pytest.approx(1e-6, rel=0.1)


def test_the_scatter_is_that_of_the_restricted_likelihood():
    """The likelihood with the mean integrated out, on a grid of means and scatters."""
    z, u = runs(3)
    scatters, means = np.linspace(1e-5, 4e-3, 400), np.linspace(0.045, 0.055, 2001)
    spread = np.sqrt(u**2 + scatters[:, None] ** 2)
    logs = norm.logpdf(z, means[:, None, None], spread).sum(axis=2)
    restricted = np.log(np.exp(logs - logs.max()).sum(axis=0))
    assert population(z, u).scatter == pytest.approx(scatters[np.argmax(restricted)], abs=1.2e-5)


def test_without_scatter_there_is_none():
    z, u = runs(5, n=200, scatter=0.0)
    found = population(z, u)
    assert found.scatter < 1e-4
    assert found.scatter_interval[0] == 0.0
    assert found.std == pytest.approx(1 / np.sqrt(np.sum(1 / u**2)), rel=0.1)


def test_unit_and_origin_do_not_matter():
    z, u = runs(7)
    found, moved = population(z, u), population(1e6 * (z - 1.0), 1e6 * u)
    assert moved.mean == pytest.approx(1e6 * (found.mean - 1.0), rel=1e-6)
    assert moved.scatter == pytest.approx(1e6 * found.scatter, rel=1e-5)


def test_runs_that_failed_are_left_out_and_too_few_are_refused():
    z, u = runs(7)
    z[3], u[5] = np.nan, np.inf
    assert population(z, u).runs == 18
    with pytest.raises(DataError, match="at least three fitted runs, got 2"):
        population(z[:2], u[:2])


def test_a_batch_tells_its_population():
    batch = fj.fit_batch(
        [coulomb_run(x0, seed=i) for i, x0 in enumerate((2e-3, 1.8e-3, 2.4e-3, 2.2e-3))],
        oscillator(RIGS["sliding"], "Coulomb"),
        ("mu", "damping", "stiffness"),
    )
    found = batch.population("mu")
    assert found.runs == 4
    assert abs(found.mean - 0.05) < 5 * found.std
    with pytest.raises(UsageError, match=r"no 'my'.*mu"):
        batch.population("my")
