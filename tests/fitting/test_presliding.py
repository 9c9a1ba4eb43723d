"""Start values of a contact, against creep and decays in closed form."""

import dataclasses

import numpy as np
import pytest

from fricjax import Oscillator, Trace
from fricjax.data import Segmentation
from fricjax.data.observation import DISPLACEMENT
from fricjax.fitting.guess import guess_machine
from fricjax.fitting.law_start import force_of
from fricjax.fitting.presliding import Machine, contact_of, stiffest
from fricjax.fitting.window import Window, without_ringing
from fricjax.friction import Coulomb, Dahl, Jenkins, LuGre, MaxwellSlip, Rolling, Spline, Tanh
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import RIGS, SIGMA0, SIGMA1, coulomb_run, noisy

STIFFNESS, LOAD, MU = 2574.0, 9.66, 0.05
FORCE = MU * LOAD
BAND = FORCE / STIFFNESS
HALF_PERIOD = np.pi * np.sqrt(PROTOTYPE_MASS / STIFFNESS)
MACHINE = Machine(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, FORCE)
NOISE = 1e-9
# Stiffness with which the deflection l of the sliding contact makes the delay sqrt(2 l x_d) as long as the noise.
LATE = FORCE / (NOISE**2 / (2 * BAND))


def at_rest_after(after, *, turned: float = -0.4 * BAND, length: float = 0.1) -> Window:
    """Record with a given motion after its last stroke.

    The last stroke is a cosine down to `turned`. The displacement `after(t)` follows.
    """
    t = np.arange(round((HALF_PERIOD + length) * 20e3)) / 20e3 - HALF_PERIOD
    before = turned + (2 * BAND - turned) * (1 - np.cos(np.pi * t / HALF_PERIOD)) / 2
    x = np.where(t < 0, before, turned + after(np.maximum(t, 0.0)))
    x = x + NOISE * np.random.default_rng(1).standard_normal(t.size)
    points = BAND * np.array([-8.0, 6.0, -4.0, 2.0])
    found = Segmentation(
        noise=NOISE, resolution=0.0, release=-4 * HALF_PERIOD, turning_times=-HALF_PERIOD * np.array([4.0, 3, 2, 1]),
        turning_points=points, rest=0.0, rest_position=turned, n_half_cycles=5, amplitude=1e-3,
        half_period=HALF_PERIOD,
    )  # fmt: skip
    sigma, used = np.full(t.shape, NOISE), np.ones(t.shape, bool)
    return Window(
        trace=Trace(t, x, sigma=NOISE), observation=DISPLACEMENT, segmentation=found, origin=0.0, t_start=0.0,
        used=used, moving=used, repeated=~used, sigma=sigma, sigma_source="given", half_cycles=4, nuisances=(),
        guesses={},
    )  # fmt: skip


@pytest.mark.parametrize("sigma0", [3e4, 1e6, 1e7])
@pytest.mark.parametrize("ratio", [0.02, 0.2])
def test_a_ringing_tells_stiffness_and_damping(sigma0, ratio):
    """Add ringing at the Dahl resonance to a fourfold creep."""
    omega = np.sqrt((STIFFNESS + sigma0) / PROTOTYPE_MASS)
    swing = lambda t: 50e-9 * (1 - np.exp(-ratio * omega * t) * np.cos(omega * t))
    window = at_rest_after(lambda t: swing(t) + 200e-9 * (1 - np.exp(-t / 0.03)))
    found = contact_of([window], MACHINE, 0.0)
    assert found.stiffness == pytest.approx(sigma0, rel=0.1)
    assert found.damping == pytest.approx(2 * ratio * omega * PROTOTYPE_MASS - PROTOTYPE_DAMPING, rel=0.5)


def test_a_spring_back_without_ringing_tells_them_too():
    """Let a Dahl contact return by l ln(2/(1 - a/x_d)).

    Strong contact damping makes the return a first-order creep.
    """
    sigma0, sigma1 = 1e6, 6e3
    back = FORCE / sigma0 * np.log(2 / (1 - 0.4))
    window = at_rest_after(lambda t: back * (1 - np.exp(-t * sigma0 / sigma1)))
    found = contact_of([window], MACHINE, 0.0)
    assert found.stiffness == pytest.approx(sigma0, rel=0.05)
    assert found.damping == pytest.approx(sigma1, rel=0.1)


@pytest.mark.parametrize("returned", [None, 0.0, 1e-6])
def test_a_contact_that_does_not_spring_back_turns_no_later_than_the_noise_lets_it(returned):
    found = contact_of([at_rest_after(np.zeros_like)], MACHINE, returned)
    assert found == (LATE, pytest.approx(2 * np.sqrt(PROTOTYPE_MASS * (STIFFNESS + LATE))))


def test_a_contact_is_as_good_as_rigid_where_all_samples_do_not_show_how_late_it_turns():
    window = at_rest_after(np.zeros_like)
    assert stiffest([window], MACHINE) == pytest.approx(LATE * window.used.sum() / 0.3**2)


def test_the_rest_nearest_to_the_equilibrium_tells_the_contact():
    """Combine a rest near the equilibrium with one far from it.

    Far from the equilibrium the contact has begun to yield, and its creep is much larger.
    """
    back = FORCE / 1e6 * np.log(2 / (1 - 0.4))
    near = at_rest_after(lambda t: back * (1 - np.exp(-t * 166.0)))
    far = at_rest_after(lambda t: 8 * back * (1 - np.exp(-t * 166.0)), turned=-0.8 * BAND)
    for windows in ([near, far], [far, near]):
        assert contact_of(windows, MACHINE, 0.0).stiffness == pytest.approx(1e6, rel=0.05)


def test_a_record_that_ends_with_the_motion_tells_nothing_of_the_contact():
    assert contact_of([at_rest_after(np.zeros_like, length=0.01)], MACHINE, None) == (None, None)
    assert contact_of([at_rest_after(np.zeros_like, length=0.01)], MACHINE, 0.0).stiffness == FORCE / NOISE


def test_the_energy_returned_at_each_reversal_tells_the_stiffness():
    """Use turning points of the undamped Dahl map.

    The map is a' = -x_d + sqrt((a - x_d)^2 + 4 x_d l).
    """
    sigma0 = 1e5
    points = [2e-3]
    while len(points) < 6:
        points.append(-BAND + np.sqrt((points[-1] - BAND) ** 2 + 4 * BAND * FORCE / sigma0))
    n = np.arange(len(points))
    found = dataclasses.replace(
        at_rest_after(np.zeros_like).segmentation, turning_points=np.array(points) * (-1.0) ** n,
        turning_times=HALF_PERIOD * n, rest=None,
    )  # fmt: skip
    oscillator = Oscillator(PROTOTYPE_MASS, STIFFNESS, 0.0, LOAD, Coulomb(MU))
    known = {"mass": PROTOTYPE_MASS, "stiffness": STIFFNESS, "damping": 0.0, "normal_force": LOAD, "drag": 0.0}
    told = guess_machine(oscillator, [found], ("mu", "returned"), {**known, "mu": 0.2})
    assert told["mu"] == pytest.approx(MU, rel=1e-3)
    contact = contact_of([], MACHINE, told["returned"])
    assert contact.stiffness == pytest.approx(sigma0, rel=0.02)


def test_swings_of_the_contact_are_no_half_cycles():
    found = at_rest_after(np.zeros_like).segmentation
    ringing = np.array([0.0, 0.007, 0.013, 0.02])  # s
    mixed = dataclasses.replace(
        found, turning_times=np.append(found.turning_times, ringing), rest=None, half_period=0.007,
        turning_points=np.append(found.turning_points, 1e-7 * ringing),
    )  # fmt: skip
    cleaned = without_ringing(mixed)
    np.testing.assert_allclose(cleaned.turning_times, found.turning_times)
    assert cleaned.rest == 0.0 and cleaned.half_period == pytest.approx(HALF_PERIOD)
    assert without_ringing(found) is found


@pytest.mark.parametrize(
    ("law", "stiffness", "damping"),
    [
        (LuGre(0.1, sigma0=1e5, sigma1=30.0, sigma2=2.0), 1e5, 32.0),
        (Dahl(0.1, sigma0=2e5), 2e5, 0.0),
        (Rolling(0.1, length=1e-4), 0.2 / 1e-4, 0.0),
        (Jenkins(0.1, sigma0=3e5), 3e5, 0.0),
        (MaxwellSlip((1e5, 2e5), (0.02, 0.03)), 3e5, 0.0),
        (Tanh(0.1, 1e-3) + LuGre(0.1, sigma0=1e5, sigma1=30.0), 1e5, 30.0 + 0.2 / 1e-3),
    ],
)
def test_the_forces_of_a_law_tell_its_contact(law, stiffness, damping):
    values, _ = force_of(law, 2.0, 0.1)
    assert values.stiffness == pytest.approx(stiffness) and values.damping == pytest.approx(damping)


def test_a_fit_starts_near_the_truth_from_any_oscillator():
    start = Oscillator(PROTOTYPE_MASS, 2000.0, 3.0, LOAD, LuGre(0.3, sigma0=5e6, sigma1=1.0))
    problem = problem_of(noisy("sliding", "LuGre", 0), start, ("mu", "damping", "stiffness", "sigma0", "sigma1"))
    found = {parameter.name: parameter.start for parameter in problem.parameters}
    assert found["mu"] == pytest.approx(RIGS["sliding"].mu, rel=0.05)
    assert found["sigma0"] == pytest.approx(SIGMA0, rel=0.2)
    assert found["sigma1"] == pytest.approx(SIGMA1, rel=0.5)


def test_a_curve_of_forces_starts_as_a_whole_where_the_decay_is():
    forces = np.array([0.03, 0.026, 0.024, 0.027])
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Spline((0.0, 0.02, 0.06, 0.15), forces))
    problem = problem_of(coulomb_run(mu=0.05), machine, tuple(f"forces_{i}" for i in range(4)))
    starts = np.array([parameter.start for parameter in problem.parameters[:4]])
    assert np.allclose(starts / starts[0], forces / forces[0], rtol=1e-12)
    assert np.mean(starts) == pytest.approx(0.05, rel=0.3)
