"""Next release and number of runs, against campaigns of an independent oracle."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from tests.oracles import coulomb_viscous
from tests.sensitivity.machines import SLIDING, STIFFNESS, prototype

MU = 0.05
BAND = SLIDING / STIFFNESS
RANGE = (0.5e-3, 2e-3)
WANTED = 0.02


def answers(machine, x0, mu_s):
    """Limits of mu_s from a run of the oracle.

    They are the largest coefficient that was needed to hold the mass, and the smallest that was exceeded.
    """
    frequency, zeta = float(machine.angular_frequency) / (2 * np.pi), float(machine.damping_ratio)
    points = coulomb_viscous(
        np.zeros(1), x0, frequency=frequency, zeta=zeta, dead_band=MU * BAND, static_band=mu_s * BAND
    ).points
    asked = np.abs(np.append(x0, points)) / BAND
    return asked[-1], asked[:-1].min()


def runs_needed(machine, mu_s, choose):
    """Number of runs to a standard uncertainty of mu_s of 2 %."""
    low, high = MU, 1.6 * MU
    for runs in range(1, 1000):
        held, moved = answers(machine, choose(low, high), mu_s)
        low, high = max(low, held), min(high, moved)
        assert low <= mu_s <= high
        if (high - low) / np.sqrt(12) <= WANTED * (low + high) / 2:
            return runs
    raise AssertionError("the campaign does not end")


@pytest.mark.slow
def test_chosen_releases_need_less_than_half_of_the_runs_of_a_uniform_spread():
    machine, rng = prototype(fj.friction.Coulomb(MU)), np.random.default_rng(2)
    found = {}

    def best(low, high):
        # Campaigns with the same beginning choose the same releases.
        key = (round(low, 6), round(high, 6))
        if key not in found:
            found[key] = fj.sensitivity.next_release(machine, RANGE, (low, high)).x0
        return found[key]

    truths = rng.uniform(MU, 1.6 * MU, 200)
    chosen = np.array([runs_needed(machine, mu_s, best) for mu_s in truths])
    spread = np.array([runs_needed(machine, mu_s, lambda *_: rng.uniform(*RANGE)) for mu_s in truths])
    print(f"runs for mu_s to 2 %: {chosen.mean():.2f} chosen, {spread.mean():.2f} spread uniformly")
    assert chosen.mean() <= 0.5 * spread.mean()
    # Three halvings reduce the interval from 46 % to less than 7 % of its middle.
    assert chosen.max() <= 4


def test_without_scatter_a_run_halves_the_interval():
    best = fj.sensitivity.next_release(prototype(fj.friction.Coulomb(MU)), RANGE, (MU, 1.2 * MU))
    assert best.expected_std / best.std == pytest.approx(0.5, abs=0.01)
    asked = sorted(abs(each.displacement) / BAND for each in best.outcomes)
    assert asked[-1] == pytest.approx(1.1 * MU, rel=2e-3)
    assert sum(each.probability for each in best.outcomes) == pytest.approx(1.0)


def test_scatter_leaves_less_to_be_told():
    machine = prototype(fj.friction.Coulomb(MU))
    sure, unsure = (
        fj.sensitivity.next_release(machine, RANGE, (MU, 1.2 * MU), scatter=scatter).expected_std
        for scatter in (1e-4, 0.1)
    )
    assert sure < 0.52 * 0.2 * MU / np.sqrt(12) < unsure


@pytest.mark.slow
def test_the_expected_variance_is_that_of_simulated_answers():
    """Simulate runs from the chosen release for random values of mu_s."""
    machine, interval = prototype(fj.friction.Coulomb(MU)), (MU, 1.5 * MU)
    best = fj.sensitivity.next_release(machine, RANGE, interval)
    drawn = np.random.default_rng(1).uniform(*interval, 4000)
    ends = np.array([answers(machine, best.x0, mu_s) for mu_s in drawn])
    widths = np.minimum(ends[:, 1], interval[1]) - np.maximum(ends[:, 0], interval[0])
    assert np.sqrt(np.mean(widths**2 / 12)) == pytest.approx(best.expected_std, rel=0.02)


def test_runs_add_their_information():
    machine = prototype(fj.friction.Coulomb(MU))
    plan = fj.sensitivity.design(
        machine, [0.5e-3, 1e-3, 2e-3], {"mu": 4e-8, "damping": 1e-6}, ["mu", "damping", "stiffness"]
    )
    one = fj.sensitivity.fisher(machine, 1e-3, names=["mu", "damping", "stiffness"])
    needed = max(one.std_errors["mu"] / MU / 4e-8, one.std_errors["damping"] / one.values["damping"] / 1e-6) ** 2
    assert plan.runs[1] == np.ceil(needed)
    # One half-cycle gives only its centre, even if it is repeated many times.
    assert plan.runs[0] == np.inf and plan.best.x0 == 2e-3
    assert "none reaches it" in plan.summary()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (((2e-3, 1e-3), (0.05, 0.07)), "x0 must be a smaller and a larger positive number [m], got 0.002 and 0.001."),
        (((1e-3, 2e-3), (0.0, 0.07)), "interval must be a smaller and a larger positive number, got 0.0 and 0.07."),
    ],
)
def test_a_release_of_nothing_is_refused(arguments, sentence):
    with pytest.raises(UsageError) as refusal:
        fj.sensitivity.next_release(prototype(fj.friction.Coulomb(MU)), *arguments)
    assert str(refusal.value) == sentence


def test_a_target_of_what_is_not_fitted_is_refused():
    with pytest.raises(UsageError, match=r"nu is not fitted\. Did you mean 'mu'\?"):
        fj.sensitivity.design(prototype(fj.friction.Coulomb(MU)), [1e-3], {"nu": 1e-6}, ["mu", "stiffness"])
    with pytest.raises(UsageError, match="a stop determines no static coefficient"):
        fj.sensitivity.next_release(prototype(fj.friction.Tanh(MU, 1e-4)), RANGE, (0.05, 0.07))
