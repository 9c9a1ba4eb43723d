"""Static coefficient by bracketing and by stop probability, against simulated campaigns."""

import numpy as np
import pytest
from scipy.stats import norm

from fricjax import Rig, fit_triangle_map
from fricjax.data import example_paths
from fricjax.errors import DataError
from fricjax.pairs import attempts, bracket, probit
from tests.pairs.campaigns import BAND, LOAD, MU, STIFFNESS, machine, released

STATIC = 1.3 * BAND


def test_the_bracket_holds_the_truth_and_has_the_known_width():
    """Check the median width of the bracket from forty undamped runs.

    Releases of up to 12 dead bands give a width of 0.074 dead bands.
    """
    random, widths = np.random.default_rng(0), []
    undamped = machine(MU, damping=0.0)
    for _ in range(200):
        y0 = random.uniform(1.31, 12, 40) * BAND
        runs = [released(y, static=STATIC, rho=1.0) for y in y0]
        found = bracket(undamped, y0, np.array([r[0] for r in runs]), np.array([len(r[1]) - 1 for r in runs]))
        assert found.lower_band - 1e-15 <= STATIC <= found.upper_band + 1e-15
        widths.append((found.upper_band - found.lower_band) / BAND)
    assert np.median(widths) == pytest.approx(0.074, rel=0.2)


def test_all_states_at_rest_are_attempts():
    y0 = np.array([1e-3, -2e-3])
    runs = [released(y, static=STATIC) for y in y0]
    counts = np.array([len(points) - 1 for _, points in runs])
    found = attempts(machine(MU), y0, np.array([final for final, _ in runs]), counts)
    expected = [abs(a) for _, points in runs for a in points]
    assert np.sort(found.size) == pytest.approx(np.sort(expected), rel=1e-10)
    assert found.stopped.sum() == 2


def stops(random: np.random.Generator, scatter: float, runs: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Attempts to stop in a campaign with a scattering static band."""
    size, stopped = [], []
    for a in random.uniform(1.31, 12, runs) * BAND:
        while True:
            size.append(abs(a))
            stopped.append(abs(a) <= STATIC + scatter * random.standard_normal())
            if stopped[-1]:
                break
            a = abs(a) - 2 * BAND
    return np.array(size), np.array(stopped)


@pytest.mark.slow
def test_the_probit_interval_covers_as_it_says():
    random, covered, tried = np.random.default_rng(1), 0, 0
    while tried < 300:
        size, stopped = stops(random, 0.15 * BAND)
        try:
            found = probit(size, stopped)
        except DataError:
            continue
        tried += 1
        covered += found.interval[0] <= STATIC <= found.interval[1]
    assert 0.91 <= covered / tried <= 0.985


def test_the_maximum_is_that_of_the_likelihood():
    size, stopped = stops(np.random.default_rng(4), 0.2 * BAND, runs=200)
    found = probit(size, stopped)

    def log_likelihood(centre: float, spread: float) -> float:
        chance = norm.cdf((centre - size) / spread)
        return float(np.sum(np.log(np.where(stopped, chance, 1 - chance))))

    best = log_likelihood(found.static_band, found.scatter)
    for factor in (0.99, 1.01):
        assert log_likelihood(factor * found.static_band, found.scatter) < best
        assert log_likelihood(found.static_band, factor * found.scatter) < best
    assert found.static_band == pytest.approx(STATIC, abs=4 * found.std_errors[0])
    assert found.scatter == pytest.approx(0.2 * BAND, abs=4 * found.std_errors[1])


def test_stops_that_do_not_overlap_have_no_scatter():
    with pytest.raises(DataError, match="do not overlap"):
        probit(np.array([1.0, 2.0, 3.0, 4.0]), np.array([True, True, False, False]))


def test_stops_at_the_larger_deflections_determine_no_static_friction():
    with pytest.raises(DataError, match="did not stop more seldom at larger deflections"):
        probit(np.arange(1.0, 7.0), np.array([False, False, True, False, True, True]))


def test_the_unit_does_not_matter():
    size, stopped = stops(np.random.default_rng(4), 0.2 * BAND)
    small, large = probit(size, stopped), probit(1e6 * size, stopped)
    assert large.static_band == pytest.approx(1e6 * small.static_band, rel=1e-9)
    assert large.interval[1] == pytest.approx(1e6 * small.interval[1], rel=1e-6)
    assert STIFFNESS * small.static_band / LOAD == pytest.approx(0.065, rel=0.05)


def test_edges_that_contradict_each_other_have_a_width():
    """Analyse undamped runs with a damped rig.

    One run then stops farther out than another one moved on.
    """
    rig = Rig.from_toml(example_paths().rig)
    band, x0 = 0.02 * 9.66 / 2574.0, np.linspace(1.1e-3, 2e-3, 12)
    n = np.ceil((x0 / band - 1) / 2)
    found = fit_triangle_map(x0, (-1.0) ** n * (x0 - 2 * n * band), rig)
    width = found.extras["jump"].std
    assert width is not None and width > 0
    assert "jump" in found.summary()
