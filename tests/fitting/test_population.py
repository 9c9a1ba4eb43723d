"""Mean and scatter over runs, against simulated campaigns and a likelihood grid."""

import numpy as np
import pytest
from scipy.stats import norm

import fricjax as fj
from fricjax.errors import DataError, UsageError
from fricjax.fitting.population import population
from tests.machines import RIGS, coulomb_run, oscillator

pytestmark = pytest.mark.slow


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
    """Integrate the likelihood over the mean, on a grid."""
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


def test_a_clean_sample_hardly_ever_loses_a_run():
    """Count wrong outliers in 600 clean samples.

    The rate is about one in a hundred, so the count is binomial with mean 6.
    """
    for n in (4, 20):
        trimmed = sum(bool(population(*runs(seed, n=n)).outliers) for seed in range(600))
        assert trimmed <= 16, n


def test_runs_read_in_a_wrong_unit_are_set_aside_and_named():
    z, u = runs(0, n=184)
    clean = population(z, u)
    wrong = [3, 50, 77, 180]
    z[wrong], u[wrong] = 1e3 * z[wrong], 1e3 * u[wrong]
    found, rest = population(z, u), np.delete(np.arange(184), wrong)
    assert found.outliers == tuple(wrong) and found.runs == 180
    assert found[:6] == population(z[rest], u[rest])[:6]
    assert abs(found.mean - clean.mean) < clean.std / 3
    assert "over 180 runs" in str(found) and "outliers set aside: runs 3, 50, 77, 180" in str(found)


@pytest.mark.parametrize("n", [6, 12, 60])
def test_intervals_cover_as_they_say_beside_outliers(n):
    """Displace a third of the runs, less one, to one side.

    They lie off by twenty to a hundred times the scatter.
    """
    found = []
    for seed in range(300):
        random = np.random.default_rng(1000 + seed)
        z, u = runs(seed, n=n, scatter=2e-3)
        u = np.minimum(u, 5e-4)
        z = 0.05 + 2e-3 * random.standard_normal(n) + u * random.standard_normal(n)
        far = n // 3 - 1
        z[:far] += 2e-3 * random.uniform(20, 100, far)
        found.append(population(z, u))
    mean = np.mean([p.interval[0] <= 0.05 <= p.interval[1] for p in found])
    assert 0.90 <= mean <= 0.99


def test_few_runs_that_scatter_keep_all_of_them():
    """Keep runs that lie apart from two close ones."""
    found = population(np.array([0.05, 0.0501, 0.06, 0.057]), np.full(4, 1e-6))
    assert found.outliers == () and found.runs == 4


def test_runs_that_have_not_converged_are_left_out_unless_they_are_asked_for():
    """Fit four runs, two of them with a fringe slip in mid-stroke."""
    good = [coulomb_run(x0, seed=i) for i, x0 in enumerate((2e-3, 1.8e-3))]
    slipped = [fj.Trace(run.t, np.where(np.arange(run.n) < 500, run.x, run.x + 316.4e-9)) for run in good]
    batch = fj.fit_batch([*good, *slipped], oscillator(RIGS["sliding"], "Coulomb"), ("mu", "damping", "stiffness"))
    assert batch.described.tolist() == [True, True, False, False]
    with pytest.raises(DataError, match=r"got 2\. 2 are not described though .* only_described=False counts them"):
        batch.population("mu")
    assert batch.population("mu", only_described=False).runs == 4
    three = fj.fit_batch([*good, coulomb_run(2.4e-3), slipped[0]], oscillator(RIGS["sliding"], "Coulomb"), ("mu",))
    assert three.population("mu").left_out == (3,)
