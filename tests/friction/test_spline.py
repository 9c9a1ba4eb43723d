"""Spline friction laws against SciPy, and fits to other laws."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from fricjax import Oscillator, Trace, fit
from fricjax.energy_loss.force_fit import fit_force_map
from fricjax.energy_loss.force_map import ForceMap
from fricjax.friction import Coulomb, MonotoneSpline, Spline, Stribeck, Tanh
from fricjax.oscillator import simulate
from fricjax.oscillator.oscillator import leaves_of
from fricjax.rig import Measured
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import Machine, slide

STIFFNESS, LOAD, X0 = 2574.0, 9.66, 2e-3
KNOTS = np.array([0.0, 4e-3, 7e-3, 13e-3, 24e-3, 44e-3, 81e-3, 0.15])
FORCES = np.array([0.065, 0.0645, 0.063, 0.0597, 0.0533, 0.0501, 0.05, 0.051])
SPEEDS = np.concatenate([[0.0], np.geomspace(1e-5, 0.15, 200), KNOTS])
BOTH = pytest.mark.parametrize("kind", [Spline, MonotoneSpline])


def stretched(speed: np.ndarray) -> np.ndarray:
    return np.log(1 + speed / KNOTS[1])


def smoothest(forces: np.ndarray) -> CubicSpline:
    """Cubic spline with free first and clamped last end.

    The curvature is zero at the first speed, the slope at the last.
    """
    level = np.zeros(np.shape(forces)[1:])
    return CubicSpline(stretched(KNOTS), forces, bc_type=((2, level), (1, level)))  # pyright: ignore[reportArgumentType]


def monotone(forces: np.ndarray) -> CubicHermiteSpline:
    """Monotone spline with limited slopes of the smoothest one.

    The slopes are limited to between 0 and 3 times those of both neighbouring secants.
    """
    knots = stretched(KNOTS)
    slopes, lines = smoothest(forces).derivative()(knots), np.diff(forces) / np.diff(knots)
    for i, slope in enumerate(slopes):
        near = lines[max(i - 1, 0) : i + 1]
        steepest = 3 * np.min(np.abs(near)) if np.all(near > 0) or np.all(near < 0) else 0.0
        slopes[i] = np.sign(near[0]) * np.clip(np.sign(near[0]) * slope, 0.0, steepest)
    return CubicHermiteSpline(knots, forces, slopes)


def sliding(law, speed) -> np.ndarray:
    return np.asarray(law.sliding_force(jnp.asarray(speed), jnp.asarray(LOAD)))


@pytest.mark.parametrize(("kind", "oracle"), [(Spline, smoothest), (MonotoneSpline, monotone)])
@pytest.mark.parametrize("forces", [FORCES, FORCES[::-1], np.tile([0.1, 0.0], 4), np.full(8, 0.1)])
def test_the_curve_is_that_of_scipy(kind, oracle, forces):
    expected = LOAD * oracle(forces)(stretched(SPEEDS))
    np.testing.assert_allclose(sliding(kind(KNOTS, forces), SPEEDS), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@BOTH
def test_its_derivative_is_continuous_and_vanishes_beyond_the_last_speed(kind):
    law = kind(KNOTS, FORCES)
    slope = jax.vmap(jax.grad(lambda u: law.sliding_force(u, jnp.asarray(LOAD))))
    oracle = {Spline: smoothest, MonotoneSpline: monotone}[kind](FORCES).derivative()
    expected = LOAD * oracle(stretched(SPEEDS)) / (SPEEDS + KNOTS[1])
    np.testing.assert_allclose(slope(jnp.asarray(SPEEDS)), expected, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(slope(jnp.asarray([0.2, 10.0])), 0.0)
    np.testing.assert_allclose(sliding(law, [0.15, 0.2, 1e6]), LOAD * FORCES[-1], rtol=1e-15)


def test_a_monotone_spline_does_not_overshoot():
    forces, speeds = (0.1, 0.1, 0.1, 0.02, 0.02, 0.02, 0.05, 0.05), np.linspace(0, 0.2, 5001)
    assert sliding(Spline(KNOTS, forces), speeds).min() < 0.019 * LOAD
    curve = sliding(MonotoneSpline(KNOTS, forces), speeds)
    assert curve.min() >= 0.02 * LOAD - 1e-15 and curve.max() <= 0.1 * LOAD + 1e-15


@BOTH
def test_its_values_have_names(kind):
    machine = Oscillator(1.0, 1.0, 0.0, LOAD, kind(KNOTS[:3], (0.1, 0.2, 0.3)))
    named = [leaf for leaf in leaves_of(machine) if leaf.name.startswith("forces")]
    assert [leaf.name for leaf in named] == ["forces_0", "forces_1", "forces_2"]
    assert {leaf.coefficient.lower for leaf in named} == {0.0}


@pytest.mark.parametrize(("law", "at_rest"), [(Stribeck(0.05, 0.065, 5e-3), 0.065), (Tanh(0.05, 1e-3), 0.05)])
def test_it_starts_like_another_law(law, at_rest):
    found = Spline.like(law, KNOTS, LOAD)
    assert isinstance(found, Spline)
    np.testing.assert_allclose(sliding(found, KNOTS), sliding(law.set_valued_limit(), KNOTS), rtol=1e-14)
    assert found.static_force(jnp.asarray(LOAD)) == pytest.approx(at_rest * LOAD)
    assert found.velocity_scale() == KNOTS[1]


def stribeck(speed):
    return LOAD * (0.05 + 0.015 * np.exp(-((speed / 20e-3) ** 2)))


def machine(law) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD, law)


@pytest.mark.slow
@BOTH
def test_a_force_map_gives_the_curve(kind):
    v = np.concatenate([s * np.geomspace(5e-4, 0.15, 60) for s in (1.0, -1.0)])
    std = 1e-3 * np.ones(v.size)
    force = np.sign(v) * stribeck(np.abs(v)) + std * np.random.default_rng(1).standard_normal(v.size)
    ones = np.ones(v.size, int)
    made = ForceMap(
        v, force, std, edges=np.abs(v), mean=Measured(0.5, 1e-3), normal_force=LOAD, direction=np.sign(v).astype(int),
        branch=ones, count=ones, damping=0.0, drag=0.0, offsets=(), quantity="m", notes=(),
    )  # fmt: skip
    found = fit_force_map(made, kind.like(Coulomb(0.055), KNOTS, LOAD))
    assert found.converged and list(found.values) == [f"forces_{i}" for i in range(8)]
    speeds = np.geomspace(2e-3, 0.15, 50)
    np.testing.assert_allclose(sliding(found.friction, speeds), stribeck(speeds), rtol=5e-3)
    if kind is Spline:  # linear in its values, so that SciPy's spline gives the least squares
        design = smoothest(np.eye(8))(stretched(np.abs(v))) * (np.sign(v) * LOAD)[:, None]
        solution = np.linalg.lstsq(design, force, rcond=None)[0]
        np.testing.assert_allclose(list(found.values.values()), solution, rtol=1e-6)


@functools.cache
def decay(samples: int, oracle: Callable = smoothest) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, and motions under Stribeck's law and a spline through FORCES."""
    t = np.arange(samples) * 0.3 / samples
    curve = oracle(FORCES)
    laws = (stribeck, lambda u: LOAD * float(curve(stretched(u))))
    motions = [
        slide(Machine(PROTOTYPE_MASS, PROTOTYPE_DAMPING, lambda x: STIFFNESS * x, law, LOAD * 0.065), X0, 0.0, t).x
        for law in laws
    ]
    return t, motions[0], motions[1]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "oracle"), [(Spline, smoothest), (MonotoneSpline, monotone)])
def test_the_motion_is_that_of_an_ode_solver(kind, oracle):
    t, _, expected = decay(3000, oracle)
    motion = simulate(machine(kind(KNOTS, FORCES)), X0, t)
    assert motion.engine == "hybrid"
    np.testing.assert_allclose(motion.x, expected, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_a_trace_gives_the_curve():
    t, x, _ = decay(3000)
    trace = Trace(t, x + 1e-9 * np.random.default_rng(0).standard_normal(t.size), sigma=1e-9)
    start = Spline.like(Stribeck(0.05, 0.06, 10e-3), KNOTS, LOAD)
    found = fit(trace, machine(start), [f"forces_{i}" for i in range(8)], throw=False)
    assert found.converged and found.numerical_shift < 0.3
    highest = float(np.max(np.abs(np.gradient(x, t))))
    speeds = np.geomspace(2e-3, highest, 60)
    np.testing.assert_allclose(sliding(found.oscillator.friction, speeds), stribeck(speeds), rtol=5e-3)
