"""Response to a missing force, against the difference of two simulated motions."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import Observation, Oscillator, fit, observe, simulate, synthetic_run
from fricjax.fitting.derived import derive
from fricjax.fitting.responses import responses
from fricjax.friction import Coulomb, Dahl, Stribeck
from fricjax.oscillator.restoring import Cubic
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS

RELEASE = 2e-3


def machine(law=None, damping=PROTOTYPE_DAMPING, **more) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, 1.89, Coulomb(0.01) if law is None else law, **more)


# Machines with a small missing force, and the part of the difference that its response may leave. The tolerance is
# larger for falling friction and for a contact, because their scale is not known.
LACKING = {
    "damping": (machine(damping=1.001 * PROTOTYPE_DAMPING), 0.01),
    "drag": (machine(drag=1e-3), 0.01),
    "falling": (machine(Stribeck(0.01, 0.01001, 0.03)), 0.25),
    "contact": (machine(Dahl(0.01, 1e6)), 0.15),
    "softening": (machine(restoring=Cubic(-1e4)), 0.03),
    "stiffening": (machine(restoring=Cubic(1e4)), 0.03),
}


@pytest.fixture(scope="module")
def problem():
    """Return the problem of a fit of the plain machine."""
    run = synthetic_run(machine(), RELEASE, rate=5e3, duration=0.6, noise=1e-9, seed=1)
    return fit(run, machine(), MACHINE).problem


@pytest.mark.slow
@pytest.mark.parametrize("name", LACKING)
def test_a_force_moves_the_mass_as_two_simulations_differ(problem, name):
    (window,) = problem.windows
    more, tolerance = LACKING[name]
    t = np.linspace(window.segmentation.turning_times[0], window.segmentation.turning_times[-1], 1000)

    def motion(oscillator: Oscillator, x0: float = RELEASE, later: float = 0.0) -> np.ndarray:
        return np.asarray(simulate(oscillator, x0, ts=t - later).x)

    plain = motion(machine())
    # The response begins at the first reversal. The motions already differ there, as after another release.
    releases = np.stack(
        [motion(machine(), (1 + 1e-6) * RELEASE) - plain, motion(machine(), later=1e-7) - plain], axis=1
    )
    derived = derive(problem.residual, jnp.zeros(len(problem.names)))
    known = responses(window, derived, set(), t - window.origin)
    assert known.half_cycles == window.segmentation.turning_times.size
    ((names, effect),) = [pair for pair in zip(known.forces, known.effects.T, strict=True) if name in pair[0]]
    left, size = _fitted(motion(more) - plain, np.column_stack([effect, releases]))
    assert names[size < 0] == name and left < tolerance


def _fitted(measured: np.ndarray, columns: np.ndarray) -> tuple[float, float]:
    """Fit columns to a curve.

    Return the residual norm over that without the first column, and the coefficient of the first column.
    """
    columns = columns / np.linalg.norm(columns, axis=0)
    beside = columns[:, 1:] @ np.linalg.lstsq(columns[:, 1:], measured, rcond=None)[0]
    solution = np.linalg.lstsq(columns, measured, rcond=None)[0]
    return float(np.linalg.norm(measured - columns @ solution) / np.linalg.norm(measured - beside)), float(solution[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["velocity", "acceleration"])
@pytest.mark.parametrize("name", ["damping", "drag", "softening"])
def test_a_force_moves_other_readings_as_two_simulations_differ(problem, kind, name):
    (window,), observation = problem.windows, Observation(kind)
    window = dataclasses.replace(window, observation=observation)
    more, tolerance = LACKING[name]
    reversals = window.segmentation.turning_times
    t = np.linspace(reversals[0], reversals[-1], 1000)
    # Near a reversal the reading may be that of either side.
    t = t[np.min(np.abs(t[:, None] - reversals), axis=1) > 0.05 * window.segmentation.half_period]

    def reading(oscillator: Oscillator, x0: float = RELEASE, later: float = 0.0) -> np.ndarray:
        return np.asarray(observe(oscillator, simulate(oscillator, x0, ts=t - later), observation))

    plain = reading(machine())
    releases = np.stack(
        [reading(machine(), (1 + 1e-6) * RELEASE) - plain, reading(machine(), later=1e-7) - plain], axis=1
    )
    known = responses(window, derive(problem.residual, jnp.zeros(len(problem.names))), set(), t - window.origin)
    ((names, effect),) = [pair for pair in zip(known.forces, known.effects.T, strict=True) if name in pair[0]]
    left, size = _fitted(reading(more) - plain, np.column_stack([effect, releases]))
    # The phases of the response are a thirtieth of a half-cycle apart, and its amplitude that of the displacement.
    assert names[size < 0] == name and left < 3 * tolerance
