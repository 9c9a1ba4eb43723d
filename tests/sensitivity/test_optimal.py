"""Optimal designs against finite differences and random releases."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.sensitivity.optimal import _Space, criterion_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.sensitivity.machines import prototype

pytestmark = pytest.mark.slow

NAMES = ["mu", "damping", "stiffness"]
MACHINE = prototype(fj.friction.Coulomb(0.05))
RANGE = (0.5e-3, 2e-3)


@pytest.mark.parametrize("criterion", ["c", "D"])
def test_the_slope_of_the_criterion_is_that_of_differences(criterion):
    space, wanted = _Space(MACHINE, tuple(NAMES), 1e4, np.inf, 1e-9), np.array([1e-7, 1e-6, np.inf])

    def value(x0, load):
        return criterion_of(space.information(x0, load).matrix, wanted, criterion)[0]

    at, step = (1.9e-3, 9.66), 1e-4
    information, slopes, half_cycles, _ = space.information(*at)
    _, by_matrix = criterion_of(information, wanted, criterion)
    found = np.einsum("ij,ijk->k", by_matrix, slopes)
    up, down = np.exp(step), np.exp(-step)
    by_release = (value(at[0] * up, at[1]) - value(at[0] * down, at[1])) / (2 * step)
    by_load = (value(at[0], at[1] * up) - value(at[0], at[1] * down)) / (2 * step)
    assert found == pytest.approx([by_release, by_load], rel=1e-6) and half_cycles == 5


def test_the_information_is_that_of_a_planned_run():
    space = _Space(MACHINE, tuple(NAMES), 1e4, np.inf, 1e-9)
    errors = np.sqrt(np.diag(np.linalg.inv(space.information(1.9e-3, 9.66).matrix)))
    planned = fj.sensitivity.fisher(MACHINE, 1.9e-3, names=NAMES, nuisance=("x0", "t_release", "offset"))
    assert errors == pytest.approx([planned.std_errors[name] / planned.values[name] for name in NAMES], rel=5e-3)


def test_chosen_runs_leave_less_than_as_many_others():
    """Compare with two hundred campaigns of four random releases."""
    targets = {"mu": 3e-8, "damping": 1e-7}
    best = fj.sensitivity.optimal_runs(MACHINE, RANGE, targets, NAMES, runs=4)
    assert not best.reached and "do not reach the targets" in best.summary()
    last = best.points[-1].std_errors
    chosen = np.linalg.norm([last[name] / target for name, target in targets.items()])
    space, rng, spread = _Space(MACHINE, tuple(NAMES), 1e4, np.inf, 1e-9), np.random.default_rng(1), []
    known = [space.information(float(x0), 9.66).matrix for x0 in rng.uniform(*RANGE, 40)]
    for _ in range(200):
        inverse = np.linalg.inv(sum(known[i] for i in rng.integers(0, 40, 4)))
        spread.append(np.linalg.norm([np.sqrt(inverse[i, i]) / target for i, target in enumerate(targets.values())]))
    assert chosen < 1.02 * np.min(spread) and chosen < 0.85 * np.median(spread)
    # Each run lowers the error.
    errors = [point.std_errors["damping"] for point in best.points]
    assert errors == sorted(errors, reverse=True)
    assert best.plot().get_axes()[-1].get_xlabel() == "Run"
    # The same runs with more samples per second reach the targets, with no run to spare.
    faster = fj.sensitivity.optimal_runs(MACHINE, RANGE, targets, NAMES, runs=4, rate=1.001 * best.rate_for_targets)
    assert faster.reached and len(faster.points) == 4
    assert faster.rate_for_targets == pytest.approx(best.rate_for_targets, rel=1e-6)


def test_a_mass_that_never_stops_is_recorded_for_as_long_as_is_said():
    """Compare a frictionless mass with a decaying cosine.

    For every machine, a shorter record has less information.
    """
    swinging, names = prototype(fj.friction.Coulomb(0.0)), ["damping", "stiffness"]
    with pytest.raises(UsageError, match="say with the duration how long to record"):
        fj.sensitivity.optimal_runs(swinging, RANGE, {"damping": 1e-6}, names)
    best = fj.sensitivity.optimal_runs(swinging, RANGE, {"damping": 1e-6}, names, runs=1, duration=4.0)
    (point,) = best.points
    assert (point.half_cycles, point.duration, point.x0) == (None, 4.0, RANGE[1]) and "no stop" in best.summary()
    # For a decaying cosine of unknown amplitude, the information is the weighted variance of the time.
    rate_of_decay = PROTOTYPE_DAMPING / (2 * PROTOTYPE_MASS)
    t = (np.arange(40_000) + 0.5) / 10_000
    weight = (RANGE[1] * np.exp(-rate_of_decay * t) / 1e-9) ** 2 / 2
    information = weight @ t**2 - (weight @ t) ** 2 / weight.sum()
    assert point.std_errors["damping"] == pytest.approx(1 / (rate_of_decay * np.sqrt(information)), rel=1e-2)
    whole, short = (
        fj.sensitivity.optimal_runs(MACHINE, RANGE, {"mu": 1e-9}, NAMES, runs=1, duration=end).points[0]
        for end in (None, 0.1)
    )
    assert whole.duration > 0.1 == short.duration and short.std_errors["mu"] > whole.std_errors["mu"]


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"x0": (2e-3, 1e-3)}, "x0 must be a smaller and a larger positive number, got 0.002 and 0.001"),
        ({"targets": {"nu": 1e-6}}, "nu is not fitted. Did you mean 'mu'?"),
        (
            {"targets": {"damping": 1e-6}, "names": ["mu", "dampin"]},
            "This oscillator has no coefficient 'dampin'. Did you mean 'damping'?",
        ),
        ({"targets": {}}, "at least one target"),
        ({"criterion": "A"}, "no criterion 'A'"),
        ({"x0": (0.2e-3, 0.4e-3)}, "No release in this range determines"),
    ],
)
def test_what_is_refused(settings, sentence):
    asked = {"x0": RANGE, "targets": {"mu": 1e-7}, "names": NAMES, **settings}
    with pytest.raises(UsageError) as refusal:
        fj.sensitivity.optimal_runs(MACHINE, **asked)
    assert sentence in str(refusal.value)
