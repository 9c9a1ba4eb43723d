"""Records with an uncertain number of half-cycles, and their standard errors."""

import numpy as np
import pytest

from fricjax import Fit, Trace, fit, fit_batch
from fricjax.fitting.fit import concluded
from fricjax.fitting.noise_weighting import End, doubt_of
from fricjax.fitting.rest import with_counts
from fricjax.fitting.solve import solve
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS, Rig, oscillator
from tests.oracles import Decay, coulomb_viscous

RIG = Rig(load=1.89, mu=0.01, rate=2e3, duration=4.8, noise=0.05)
"""A ball that rolls to its rest, with noise of 5 % of its amplitude."""
T = np.arange(round(RIG.rate * RIG.duration)) / RIG.rate
TRUE = {"mu": RIG.mu, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}


def clean(seed: int) -> Decay:
    omega = np.sqrt(STIFFNESS / PROTOTYPE_MASS)
    zeta = PROTOTYPE_DAMPING / (2 * PROTOTYPE_MASS * omega)
    x0, dead_band = np.random.default_rng(seed).uniform(1e-3, 2e-3), RIG.mu * RIG.load / STIFFNESS
    return coulomb_viscous(T, x0, frequency=omega / (2 * np.pi), zeta=zeta, dead_band=dead_band)


def noisy(seed: int) -> Trace:
    x = clean(seed).x
    return Trace(T, x + RIG.noise * x[0] * np.random.default_rng([1, seed]).standard_normal(T.size))


def true_number(seed: int) -> int:
    """Half-cycles behind the first reversal."""
    return clean(seed).n_half_cycles - 1


def scores(found: Fit) -> np.ndarray:
    return np.array([(found.values[name] - TRUE[name]) / found.std_errors[name] for name in MACHINE])


@pytest.fixture(scope="module")
def fits() -> list[Fit]:
    return [fit(noisy(seed), oscillator(RIG, "Coulomb"), MACHINE) for seed in range(40)]


def told(found: Fit) -> list[str]:
    return [sentence for sentence in found.warnings if "leaves the number of half-cycles" in sentence]


@pytest.mark.slow
def test_errors_are_those_of_the_mixture_of_the_fits_with_each_number(fits):
    """Compare predicted standard errors with fits of every number of half-cycles.

    A fit predicts the errors from its own optimum. Here each number is fitted to its optimum.
    """
    doubtful = [seed for seed, found in enumerate(fits) if told(found)]
    assert len(doubtful) >= 8
    for seed in doubtful[:6]:
        (taken,) = fits[seed].half_cycles
        problem = problem_of(noisy(seed), oscillator(RIG, "Coulomb"), MACHINE)
        numbers = [with_counts(problem, (taken + step,)) for step in (0, -2, -1, 1, 2)]
        ends = [concluded(number, solve(number), "absolute", throw=False) for number in numbers]
        odds = np.exp(-(np.array([end.chi2 for end in ends]) - ends[0].chi2) / 2)
        for name in MACHINE:
            away = np.array([end.values[name] - ends[0].values[name] for end in ends])
            variance = ends[0].std_errors[name] ** 2 + odds @ away**2 / odds.sum()
            assert fits[seed].std_errors[name] == pytest.approx(np.sqrt(variance), rel=0.05)


@pytest.mark.slow
def test_numbers_are_as_probable_as_they_are_often_true(fits):
    scored = np.array([scores(found) for found in fits])
    assert np.max(np.abs(scored)) < 4
    assert np.sqrt(np.mean(scored**2, axis=0)) == pytest.approx(1.0, abs=0.4)
    wrong = sum(found.half_cycles[0] != true_number(seed) for seed, found in enumerate(fits))
    expected = np.array(
        [float(sentence.split("probability of ")[1].split(". ")[0]) for f in fits for sentence in told(f)]
    )
    assert abs(wrong - expected.sum()) < 3 * np.sqrt(np.sum(expected * (1 - expected)))


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
def test_a_batch_says_and_counts_the_same(fits):
    at = next(i for i, found in enumerate(fits) if told(found))
    batch = fit_batch([noisy(at)] * 2, oscillator(RIG, "Coulomb"), MACHINE)
    assert told(fits[at]) == list(batch.warnings[0])
    for name in MACHINE:
        assert batch.std_errors[name][0] == pytest.approx(fits[at].std_errors[name], rel=1e-3)


def test_the_moments_are_those_of_draws_from_the_mixture():
    random = np.random.default_rng(0)
    ends = [End((5,), 10.0, np.array([1.0, 2.0])), End((6,), 11.0, np.array([3.0, 2.5])), End((4,), 13.0, np.zeros(2))]
    doubt = doubt_of(ends, 2)
    odds = np.exp([-5.0, -5.5, -6.5])
    drawn = random.choice(3, 100_000, p=odds / odds.sum())
    away = np.array([end.y for end in ends])[drawn] - ends[0].y
    assert doubt.covariance == pytest.approx(away.T @ away / drawn.size, rel=0.03)
    assert [other.probability for other in doubt.others] == pytest.approx(odds[1:] / odds.sum())
    assert [other.half_cycles for other in doubt.others] == [(6,), (4,)]


def test_a_number_without_rivals_is_not_in_doubt():
    doubt = doubt_of([], 3)
    assert doubt.others == () and not doubt.covariance.any() and doubt.covariance.shape == (3, 3)
