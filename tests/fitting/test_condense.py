"""Condensed records against all samples: chi^2, gradients and normal matrices."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import chebyshev

from fricjax.fitting import condense as condensing
from fricjax.fitting.condense import DEGREE, gauss_rule

TRUE = np.array([2e-3, 1.0, 2 * np.pi, 0.3, 1e-5])
NOISE = 5e-9
REVERSALS = [0.5, 1.0, 1.5, 2.0, 2.5]
MARGIN = 0.02
MARGINS = [MARGIN] * 5
RNG = np.random.default_rng(4)


class Samples(NamedTuple):
    t: np.ndarray
    x: np.ndarray
    weight: np.ndarray


def condense(every, breaks, margins) -> Samples:
    few = condensing.condense(every.t, every.weight, breaks, margins)
    return Samples(few.t, few.of(every.x), few.weight)


def motion(t, p):
    """Decay without friction, smooth through all reversals.

    The parameters are amplitude, phase, frequency, damping and offset.
    """
    return p[0] * jnp.exp(-p[3] * t) * jnp.cos(p[2] * (t - p[1])) + p[4]


@jax.jit
def with_slopes(t, p):
    return motion(t, p), jax.jacfwd(motion, argnums=1)(t, p)


def sums(samples: Samples, p):
    """Return chi^2, J'r and J'J at parameters `p`.

    The sums run over all samples at once, in float64.
    """
    x, slopes = (np.asarray(part) for part in with_slopes(samples.t, jnp.asarray(p)))
    r, jacobian = samples.weight * (x - samples.x), samples.weight[:, None] * slopes
    return r @ r, jacobian.T @ r, jacobian.T @ jacobian


def record(t, weight=None):
    x = np.asarray(motion(t, TRUE)) + NOISE * RNG.standard_normal(t.size)
    return Samples(t, x, np.full(t.size, 1 / NOISE) if weight is None else weight)


def even(n):
    return np.arange(n) * (3.0 / n)


def uneven(n):
    return np.sort(RNG.uniform(0, 3, n))


def masked(n, share=0.8):
    """Weights with random gaps and with a gap across a reversal."""
    t = even(n)
    keep = (RNG.uniform(size=n) < share) & ~((t > 1.4) & (t < 1.7))
    return np.where(keep, 1 / NOISE, 0.0)


RECORDS = {
    "even": record(even(6000)),
    "uneven": record(uneven(6000)),
    "masked": record(even(6000), masked(6000)),
    "different noise for each sample": record(even(6000), 1 / RNG.uniform(2e-9, 9e-9, 6000)),
    "noise that changes once": record(even(6000), np.where(even(6000) < 1.3, 2e8, 1e8)),
    "long panels": record(even(150_000)),
    "long uneven panels": record(uneven(80_000)),
    "tiny panels": record(even(180)),
    "no panel at all": record(even(120)),
}


@pytest.fixture(params=RECORDS.values(), ids=list(RECORDS), scope="module")
def pair(request) -> tuple[Samples, Samples]:
    return request.param, condense(request.param, REVERSALS, MARGINS)


# From far off the optimum to well within the standard errors, which are some 1e-6 of the amplitude.
@pytest.mark.parametrize("away", [1e-3, 1e-5, 1e-7])
def test_sums_of_squares_differ_by_a_constant_and_have_the_same_shape(pair, away):
    every, few = pair
    step = away * np.array([2e-3, 1.0, 6.0, 1.0, 2e-3])
    here, there = TRUE, TRUE + step
    (chi2, _, _), (chi2_there, gradient, normal) = sums(every, here), sums(every, there)
    (chi2_few, _, _), (chi2_few_there, gradient_few, normal_few) = sums(few, here), sums(few, there)
    # The times of the nodes are rounded: 3e-16 s at 13 mm/s are 1e-9 of the noise for each sample.
    rounding, change = 1e-9 * np.sqrt(every.t.size), chi2_there - chi2
    assert chi2_few_there - chi2_few == pytest.approx(change, rel=1e-11, abs=rounding * np.sqrt(step @ normal @ step))
    unit = np.sqrt(np.diag(normal))
    assert gradient_few / unit == pytest.approx(gradient / unit, abs=1e-11 * np.sqrt(chi2_there) + rounding)
    assert normal_few / np.outer(unit, unit) == pytest.approx(normal / np.outer(unit, unit), abs=1e-11)


def test_weights_are_positive_times_rise_and_stay_within_the_record(pair):
    every, few = pair
    used = every.t[every.weight > 0]
    assert np.all(few.weight > 0) and np.all(np.diff(few.t) > 0)
    assert used[0] <= few.t[0] and few.t[-1] <= used[-1]
    assert np.sum(few.weight**2) == pytest.approx(np.sum(every.weight**2), rel=1e-12)


def test_samples_around_the_reversals_are_kept_as_they_are(pair):
    every, few = pair
    near = near_a_reversal(every.t) & (every.weight > 0)
    kept = np.isin(few.t, every.t[near])
    assert kept.sum() == near.sum()
    assert np.array_equal(few.x[kept], every.x[near]) and np.array_equal(few.weight[kept], every.weight[near])


def near_a_reversal(t):
    low, high = np.subtract(REVERSALS, MARGIN), np.add(REVERSALS, MARGIN)
    return np.any((t[:, None] >= low) & (t[:, None] <= high), axis=1)


def test_each_panel_between_reversals_shrinks_to_its_nodes():
    every = RECORDS["even"]
    few = condense(every, REVERSALS, MARGINS)
    assert few.t.size == 6 * DEGREE + near_a_reversal(every.t).sum()


def test_panels_of_few_samples_are_kept_as_they_are():
    """Condense a record with six short panels.

    The panels before the first reversal and behind the last one have 29 and 28 samples.
    The other four have fewer.
    """
    assert condense(RECORDS["tiny panels"], REVERSALS, MARGINS).t.size == 180 - (29 - DEGREE) - (28 - DEGREE)
    every = RECORDS["no panel at all"]
    few = condense(every, REVERSALS, MARGINS)
    assert all(np.array_equal(ours, theirs) for ours, theirs in zip(few, every, strict=True))


@pytest.mark.parametrize(("samples", "pieces"), [(8192, 1), (8193, 2), (16385, 3)])
def test_long_panels_are_cut_in_pieces(samples, pieces):
    few = condense(record(even(samples)), [], [])
    assert few.t.size == pieces * DEGREE


def test_without_breaks_all_is_one_panel():
    polynomial = chebyshev.Chebyshev(RNG.standard_normal(DEGREE), domain=[0, 3])
    t = uneven(500)
    few = condense(Samples(t, polynomial(t), 1 / RNG.uniform(1, 2, 500)), [], [])
    assert few.t.size == DEGREE
    assert few.x == pytest.approx(polynomial(few.t), abs=1e-12)


def test_samples_at_one_instant_are_kept_apart_from_panels():
    """Add samples without weight at the instant of a used sample.

    Unused samples are moved to the nearest used instant. They must not change the result.
    """
    every = RECORDS["even"]
    weight = np.where(every.t < 0.3, 0.0, every.weight)
    moved = Samples(np.maximum(every.t, 0.3), every.x, weight)
    cut = Samples(*(values[every.t >= 0.3] for values in every))
    for ours, theirs in zip(condense(moved, REVERSALS, MARGINS), condense(cut, REVERSALS, MARGINS), strict=True):
        assert np.array_equal(ours, theirs)


PLACES = {
    "even": (np.linspace(-1, 1, 3000), np.ones(3000)),
    "barely enough": (np.linspace(-1, 1, 2 * DEGREE), np.ones(2 * DEGREE)),
    "uneven": (np.sort(RNG.uniform(-1, 1, 500)), RNG.uniform(0.1, 4.0, 500)),
    "clustered": (np.sort(RNG.beta(0.3, 2.0, 900) * 2 - 1), np.ones(900)),
    "very uneven weights": (np.linspace(-1, 1, 400), 10.0 ** RNG.uniform(-4, 4, 400)),
}


@pytest.mark.parametrize(("place", "power"), PLACES.values(), ids=PLACES.keys())
class TestGaussRule:
    def test_it_integrates_polynomials_up_to_degree_2d_minus_1_exactly(self, place, power):
        rule = gauss_rule(place, power)
        exact = power @ chebyshev.chebvander(place, 2 * DEGREE - 1)
        found = rule.weights @ chebyshev.chebvander(rule.nodes, 2 * DEGREE - 1)
        assert found / power.sum() == pytest.approx(exact / power.sum(), abs=1e-12)

    def test_weights_are_positive_and_nodes_inside(self, place, power):
        rule = gauss_rule(place, power)
        assert np.all(rule.weights > 0)
        assert np.all(np.diff(rule.nodes) > 0) and place[0] < rule.nodes[0] and rule.nodes[-1] < place[-1]

    def test_it_reads_off_the_least_squares_polynomial(self, place, power):
        rule, noisy = gauss_rule(place, power), np.cos(2 * place) + 0.1 * RNG.standard_normal(place.size)
        fitted = chebyshev.Chebyshev.fit(place, noisy, DEGREE - 1, w=np.sqrt(power), domain=[-1, 1])
        assert rule.project @ noisy == pytest.approx(fitted(rule.nodes), abs=1e-9)

    def test_one_degree_more_is_not_integrated(self, place, power):
        """Integrate the square of the orthogonal polynomial, of degree 2d.

        The integral is positive, but the rule gives zero.
        """
        rule = gauss_rule(place, power)
        highest = np.prod(place[:, None] - rule.nodes, axis=1) ** 2
        assert power @ highest > 0
        assert rule.weights @ np.prod(rule.nodes[:, None] - rule.nodes, axis=1) ** 2 == 0
