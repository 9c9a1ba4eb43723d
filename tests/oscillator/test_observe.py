"""Readings of a motion, against derivatives by differences in time."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import TypeCheckError

import fricjax as fj
from fricjax.errors import UsageError
from tests.tables import check_rows

OMEGA = 30.0
LAWS = {
    "Coulomb": (fj.friction.Coulomb(0.02), fj.restoring.Linear()),
    "Tanh": (fj.friction.Tanh(0.02, 1e-2), fj.restoring.Cubic(1e4)),
    "pendulum": (fj.friction.Coulomb(0.02), fj.restoring.Pendulum()),
}
CAMERA = fj.Observation("projection", length=0.42, angle=0.1)
# Between the reversals of all three.
TIMES = np.array([0.03, 0.06, 0.17])


def machine(law, spring):
    return fj.Oscillator(0.4, 0.4 * OMEGA**2, 0.1, 5.0, law, restoring=spring, drag=0.05)


def test_the_acceleration_is_the_derivative_of_the_velocity():
    def check(law, spring):
        oscillator, step = machine(law, spring), 1e-5
        ends = [np.asarray(fj.simulate(oscillator, 0.02, TIMES + shift).v) for shift in (-step, step)]
        motion = fj.simulate(oscillator, 0.02, TIMES)
        found = fj.observe(oscillator, motion, fj.Observation("acceleration"))
        np.testing.assert_allclose(found, (ends[1] - ends[0]) / (2 * step), rtol=1e-5)

    check_rows(check, LAWS)


def test_a_mass_at_rest_has_no_acceleration():
    oscillator = machine(*LAWS["Coulomb"])
    motion = fj.simulate(oscillator, 0.02, np.array([50.0]))
    assert bool(motion.at_rest[0]) and float(motion.x[0]) != 0.0
    assert float(fj.observe(oscillator, motion, fj.Observation("acceleration"))[0]) == 0.0


def test_the_floor_moves_under_the_mass():
    """A mass without forces stays in space."""
    free = fj.Oscillator(0.4, 1e-9, 0.0, 0.0, fj.friction.Tanh(0.0, 1e-2))
    times, floor = np.linspace(0.0, 1.0, 50), np.sin(np.linspace(0.0, 1.0, 50))
    motion = fj.simulate(free, 0.0, times, base_acceleration=floor)
    found = fj.observe(free, motion, fj.Observation("acceleration"), base_acceleration=floor)
    np.testing.assert_allclose(found, -floor, atol=1e-8)


def test_displacement_velocity_and_projection_are_those_of_the_motion():
    oscillator = machine(*LAWS["pendulum"])
    motion = fj.simulate(oscillator, 0.5, TIMES)
    assert np.array_equal(fj.observe(oscillator, motion, fj.Observation()), motion.x)
    assert np.array_equal(fj.observe(oscillator, motion, fj.Observation("velocity", "rad")), motion.v)
    expected = 0.42 * np.sin(np.asarray(motion.x) + 0.1)
    np.testing.assert_allclose(fj.observe(oscillator, motion, CAMERA), expected, rtol=1e-14)


def test_readings_can_be_differentiated():
    oscillator, camera = machine(*LAWS["pendulum"]), fj.Observation("projection", length=0.42)
    reading = lambda x0: fj.observe(oscillator, fj.simulate(oscillator, x0, jnp.asarray(TIMES)), camera)
    slope = jax.jacfwd(reading)(0.5)
    difference = (reading(0.5 + 1e-6) - reading(0.5 - 1e-6)) / 2e-6
    np.testing.assert_allclose(slope, difference, rtol=1e-5)


def test_other_arguments_are_refused():
    oscillator = machine(*LAWS["Coulomb"])
    motion = fj.simulate(oscillator, 0.02, TIMES)
    wrong: list[tuple[Any, Any, Any]] = [(None, motion, CAMERA), (oscillator, None, CAMERA), (oscillator, motion, "x")]
    for arguments in wrong:
        # Where types are checked, that check comes first.
        with pytest.raises((UsageError, TypeCheckError), match=r"must be|[Tt]ype-?check"):
            fj.observe(*arguments)
