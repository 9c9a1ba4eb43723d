"""Structural damping: a spring that is stiffer outwards than inwards."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fricjax.friction import Coulomb, LuGre
from fricjax.oscillator import Oscillator, energy, simulate
from fricjax.oscillator.restoring import Structural
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

pytestmark = pytest.mark.slow

STIFFNESS, LOAD, X0 = 2574.0, 9.66, 2e-3
T = np.linspace(0, 0.45, 901)


def machine(eta_h, mu: float = 0.05, damping: float = PROTOTYPE_DAMPING) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, LOAD, Coulomb(mu), restoring=Structural(eta_h))


def alone(t: np.ndarray, eta_h: float) -> np.ndarray:
    """Motion in closed form, without any other loss.

    Quarter swings have the stiffness k (1 - eta_h) inwards and k (1 + eta_h) outwards.
    """
    slow, fast = (np.sqrt(STIFFNESS * (1 + s * eta_h) / PROTOTYPE_MASS) for s in (-1, 1))
    half = np.pi / 2 / slow + np.pi / 2 / fast
    n = np.floor(t / half)
    size = X0 * (-np.sqrt((1 - eta_h) / (1 + eta_h))) ** n
    since = t - n * half
    later = since - np.pi / 2 / slow
    return size * np.where(later < 0, np.cos(slow * since), -(slow / fast) * np.sin(fast * later))


def by_events(eta_h: float, mu: float) -> np.ndarray:
    """Motion by SciPy, in pieces between reversals and kinks of the spring."""
    found, t, y, s = np.full(T.shape, X0), 0.0, np.array([X0, 0.0]), 1.0
    while True:
        if y[1] == 0 and STIFFNESS * (1 - eta_h) * abs(y[0]) <= mu * LOAD:
            return np.where(t <= T, y[0], found)
        moving_in = s * y[0] > 0
        done = _piece(t, y, s, eta_h * (-1 if moving_in else 1), mu * LOAD)
        t, inside = done.t[-1], (t <= T) & (done.t[-1] >= T)
        found[inside] = done.sol(T[inside])[0]
        turned = bool(done.t_events[1].size)
        y = np.array([done.y[0, -1], 0.0]) if turned else np.array([0.0, done.y[1, -1]])
        s = -s if turned else s
        if not turned:
            y[0] = -s * 1e-300  # on the far side of the kink


def _piece(t: float, y: np.ndarray, s: float, eta: float, friction: float):
    """Motion towards -s until the equilibrium or a reversal.

    The spring has the stiffness k (1 + eta).
    """

    def field(_, y):
        return [y[1], -(STIFFNESS * (1 + eta) * y[0] + PROTOTYPE_DAMPING * y[1] - s * friction) / PROTOTYPE_MASS]

    def passing(_, y):
        return y[0]

    def turning(_, y):
        return y[1]

    passing.terminal = turning.terminal = True  # type: ignore[attr-defined]
    passing.direction, turning.direction = -s, s  # type: ignore[attr-defined]
    how = {"rtol": 1e-12, "atol": 1e-16, "dense_output": True, "first_step": 1e-6}
    return solve_ivp(field, (t, 2.0), y, "DOP853", events=(passing, turning), **how)


@pytest.mark.parametrize("eta_h", [1e-3, 0.05])
def test_the_decay_of_the_spring_alone_is_the_closed_form(eta_h: float):
    motion = simulate(machine(eta_h, mu=0.0, damping=0.0), X0, T)
    np.testing.assert_allclose(motion.x, alone(T, eta_h), atol=1e-11)
    points = np.abs(np.asarray(motion.turning_points))[: int(motion.n_half_cycles) + 1]
    kept = points[np.isfinite(points)]
    np.testing.assert_allclose(kept[1:] / kept[:-1], np.sqrt((1 - eta_h) / (1 + eta_h)), rtol=1e-9)


@pytest.mark.parametrize("eta_h", [1e-3, 0.05])
def test_with_friction_and_damping_it_is_the_motion_by_events(eta_h: float):
    motion = simulate(machine(eta_h), X0, T)
    assert bool(motion.at_rest[-1])
    np.testing.assert_allclose(motion.x, by_events(eta_h, 0.05), atol=1e-10)


def test_a_driven_motion_has_the_same_spring():
    driven = simulate(machine(0.05), X0, T, base_acceleration=np.zeros(T.size), accuracy=1e-11)
    np.testing.assert_allclose(driven.x, simulate(machine(0.05), X0, T).x, atol=2e-10)


def test_energy_goes_into_the_spring():
    oscillator = machine(0.05, mu=0.0, damping=0.0)
    motion = simulate(oscillator, X0, T)
    found = energy(oscillator, motion)
    lost = np.trapezoid(found.loss_power, T)
    assert lost == pytest.approx(float(found.total[0] - found.total[-1]), rel=2e-3)
    assert np.all(np.asarray(found.hysteresis_power) >= 0)


def test_the_derivative_is_that_of_the_closed_form():
    def end(eta_h):
        return simulate(machine(eta_h, mu=0.0, damping=0.0), X0, jnp.asarray(T[::50])).x

    slope = jax.jacfwd(end)(jnp.asarray(0.02))
    h = 1e-6
    np.testing.assert_allclose(slope, (alone(T[::50], 0.02 + h) - alone(T[::50], 0.02 - h)) / (2 * h), atol=2e-7)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match=r"eta_h of Structural must lie between 0 and 0\.5, got 0\.7"):
        Structural(0.7)
    bristle = Oscillator(1.0, 100.0, 0.0, 1.0, LuGre(0.1), restoring=Structural(0.01))
    with pytest.raises(ValueError, match="internal friction of a structural spring"):
        simulate(bristle, X0, T)
