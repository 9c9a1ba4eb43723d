"""Derivatives of a decay by time, against closed forms and finite differences."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import fricjax as fj
from fricjax.tables import Start, decay, make_mesh, tabulate

MASS, STIFFNESS, LOAD, MU = 0.1, 1000.0, 10.0, 0.01
OMEGA, BAND = np.sqrt(STIFFNESS / MASS), MU * LOAD / STIFFNESS
X0 = 1e-3
# Between the reversals at multiples of pi/omega, before the stop after the fifth half-cycle.
TIMES = np.pi / OMEGA * np.array([0.2, 0.7, 1.3, 2.4, 3.9, 4.5])


def motion(mu=MU, stiffness=STIFFNESS, order=0, ts=TIMES, xp: Any = np):
    machine = fj.Oscillator(MASS, stiffness, 0.0, LOAD, fj.friction.Coulomb(mu))
    forces = tabulate(machine, ["mu", "stiffness"], speed=0.2, travel=2e-3)
    points = X0 * (-1.0) ** np.arange(6) - 2 * BAND * np.arange(6) * (-1.0) ** np.arange(6)
    return decay(forces, make_mesh(machine, forces, points), Start(X0, np.eye(8)[7]), ts, order=order, xp=xp)


def closed(order, ts, omega=OMEGA):
    """Return a derivative of cosines about shifted equilibria."""
    n = np.floor(omega * ts / np.pi).astype(int)
    side = (-1.0) ** n
    swing = X0 - 2 * BAND * n - BAND
    phase = omega * ts - np.pi * n
    return side * swing * omega**order * np.cos(phase + order * np.pi / 2) + (side * BAND if order == 0 else 0.0)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_derivative_is_that_of_the_closed_form(order):
    value, columns, rate = motion(order=order).derivative
    scale = X0 * OMEGA**order
    # Each order loses a power of the step of the quintic polynomials, about 0.1 of a radian here.
    tolerance = {1: 1e-8, 2: 1e-6, 3: 1e-4}[order]
    np.testing.assert_allclose(value, closed(order, TIMES), atol=tolerance * scale)
    if order < 3:
        np.testing.assert_allclose(rate, closed(order + 1, TIMES), atol=10 * tolerance * scale * OMEGA)
    assert columns.shape == (TIMES.size, motion().columns.shape[1])


def test_order_zero_is_the_motion_itself():
    found = motion()
    assert all(a is b for a, b in zip(found.derivative, (found.x, found.columns, found.v), strict=True))


def test_columns_of_the_velocity_are_those_of_finite_differences():
    _, columns, _ = motion(order=1).derivative
    step = 1e-5
    for place, name in enumerate(("mu", "stiffness")):
        size = {"mu": MU, "stiffness": STIFFNESS}[name] * step
        ends = [motion(order=1, **{name: value}).derivative[0] for value in _around(name, size)]
        slope = (ends[1] - ends[0]) / (2 * size)
        np.testing.assert_allclose(columns[:, place], slope, atol=1e-6 * np.abs(slope).max())


def _around(name, size):
    middle = {"mu": MU, "stiffness": STIFFNESS}[name]
    return middle - size, middle + size


def test_a_mass_at_rest_has_no_velocity():
    value, columns, rate = motion(order=1, ts=np.array([-1.0, 1.0])).derivative
    assert not np.any(value) and not np.any(columns) and not np.any(rate)


def test_numpy_and_jax_agree():
    ours = motion(order=1).derivative
    theirs = motion(order=1, xp=jnp).derivative
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, np.asarray(b), rtol=1e-9, atol=1e-12 * np.abs(a).max())
