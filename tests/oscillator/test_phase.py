"""Integration over phase against integration in time, which is more accurate."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import friction, simulate
from fricjax.oscillator import Oscillator, Smooth, starting_state
from fricjax.oscillator.engines.smooth import Mesh
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

pytestmark = pytest.mark.slow

STIFFNESS, LOAD, END, CAPACITY = 2574.0, 9.66, 0.3, 1 << 14
TIMES = 1501
ACCURACY = 1e-10
LAWS = {
    "Dahl": friction.Dahl(0.05, sigma0=1e6),
    "LuGre": friction.LuGre(0.05, 0.065, 5e-3, sigma0=1e6, sigma1=400.0, sigma2=0.1),
    "ElastoPlastic": friction.ElastoPlastic(0.05, sigma0=1e6, sigma1=400.0, breakaway_fraction=0.6),
    "BoucWen": friction.BoucWen(0.05, sigma0=1e6, n=2.0, beta=0.7),
    "Rolling": friction.Rolling(0.05, length=5e-5),
    "BlimanSorine": friction.BlimanSorine(0.07, 0.02, 0.3, 1e-4),
    "RateState": friction.RateState(0.05, a=2e-3, b=1e-3, slip_distance=1e-5),
    "Jenkins": friction.Jenkins(0.05, sigma0=1e6),
    "MaxwellSlip": friction.MaxwellSlip((4e5, 2e5), (0.02, 0.03)),
    "GeneralisedMaxwellSlip": friction.GeneralisedMaxwellSlip(
        0.05, 0.06, 0.02, stiffnesses=(4e4, 2e4), shares=(0.4,), attraction=300.0
    ),
    "Leuven": friction.Leuven(0.05, 0.06, 0.02, stiffnesses=(4e4, 2e4), shares=(0.4,), sigma1=50.0),
    "Tanh": friction.Tanh(0.05, 1e-3),
}


def machine(law: friction.AbstractFriction, scale: float = 1.0) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, scale * STIFFNESS, PROTOTYPE_DAMPING, LOAD, law)


# Meshes, machines, starts and times are arguments, and all lists of times have one length. Each law compiles once.
@jax.jit
def _meshed(oscillator: Oscillator, x0: float, v0: float, half_cycles: int) -> tuple[jax.Array, jax.Array]:
    start = starting_state(oscillator, x0, v0)
    return Smooth(ACCURACY).meshed(oscillator, start, jnp.asarray(END), jnp.asarray(half_cycles), CAPACITY)


@jax.jit
def on(steps: Mesh, oscillator: Oscillator, x0: float, v0: float, ts: np.ndarray) -> jax.Array:
    return Smooth(mesh=steps).path(oscillator, starting_state(oscillator, x0, v0)).sample(jnp.asarray(ts))[0]


@jax.jit
def in_time(oscillator: Oscillator, x0: float, v0: float, ts: np.ndarray) -> jax.Array:
    return Smooth(ACCURACY / 100).solve(oscillator, starting_state(oscillator, x0, v0), jnp.asarray(ts)).x


def mesh(oscillator: Oscillator, x0: float, v0: float, half_cycles: int = 512) -> Mesh:
    phases, times = (np.asarray(ends) for ends in _meshed(oscillator, x0, v0, half_cycles))
    return Mesh.of(phases[np.isfinite(phases)], times[np.isfinite(times)], 2 * CAPACITY)


def last_phase(steps: Mesh) -> float:
    return float(steps.ends[int(steps.n_phase)])


@pytest.mark.parametrize("name", LAWS)
def test_phase_and_time_give_the_same_motion(name):
    oscillator, ts = machine(LAWS[name]), np.linspace(0, END, TIMES)
    steps = mesh(oscillator, 2e-3, 0.0)
    assert last_phase(steps) >= 4 * np.pi * (1 - 1e-12)
    found = on(steps, oscillator, 2e-3, 0.0, ts)
    np.testing.assert_allclose(found, in_time(oscillator, 2e-3, 0.0, ts), rtol=0, atol=ACCURACY)


def test_a_list_that_is_too_short_is_full():
    few, start = 400, starting_state(machine(LAWS["Jenkins"]), 2e-3, 0.0)
    ends = jax.jit(Smooth(ACCURACY).meshed, static_argnums=4)
    _, times = ends(machine(LAWS["Jenkins"]), start, jnp.asarray(END), jnp.asarray(1), few)
    assert times.size < 450 and np.isfinite(times).all()
    _, reached = _meshed(machine(LAWS["Jenkins"]), 2e-3, 0.0, 1)
    assert np.isinf(reached[-1])


@pytest.mark.parametrize(("x0", "v0"), [(-2e-3, 0.0), (3e-4, -0.14), (-1.5e-3, 0.05), (1.5e-3, 0.05)])
def test_a_motion_may_start_anywhere_in_its_swing(x0, v0):
    oscillator, ts = machine(LAWS["LuGre"]), np.linspace(0, END, TIMES)
    found = on(mesh(oscillator, x0, v0), oscillator, x0, v0, ts)
    np.testing.assert_allclose(found, in_time(oscillator, x0, v0, ts), rtol=0, atol=ACCURACY)


@pytest.mark.parametrize(("name", "error"), [("LuGre", ACCURACY), ("RateState", ACCURACY), ("Jenkins", 4 * ACCURACY)])
def test_a_mesh_still_fits_when_the_motion_has_moved(name, error):
    """Change the motion by a thousandth.

    This moves the reversals by far more than the time in which the contact yields.
    The phase at which an element begins to slip moves too.
    """
    made, moved, ts = machine(LAWS[name]), machine(LAWS[name], 1.001), np.linspace(0, 0.19, TIMES)
    found = on(mesh(made, 3e-4, -0.14), moved, 3.003e-4, -0.1402, ts)
    np.testing.assert_allclose(found, in_time(moved, 3.003e-4, -0.1402, ts), rtol=0, atol=error)


def behind_coulomb(made: float, sigma0: float) -> tuple[float, float]:
    """Compare Dahl's law with Coulomb's, on a mesh for another stiffness.

    Return the largest distance and the delay at a slow reversal.
    """
    law, ts = friction.Coulomb(0.05), np.linspace(0, 0.19, TIMES)
    soft, stiff = (machine(friction.Dahl(0.05, sigma0=value)) for value in (made, sigma0))
    rigid = np.asarray(simulate(machine(law), 2e-3, ts, accuracy=1e-12).x)
    delay = np.sqrt(2 * 0.05 * LOAD / sigma0 * float(stiff.dead_band))
    return float(np.abs(on(mesh(soft, 2e-3, 0.0), stiff, 2e-3, 0.0, ts) - rigid).max()), delay


def test_a_stiff_contact_is_late_by_the_root_of_its_deflection():
    found = np.array([behind_coulomb(sigma0, sigma0) for sigma0 in (1e11, 1e13)])
    assert found[0, 0] / found[1, 0] == pytest.approx(10.0, rel=0.02)
    assert np.all((found[:, 1] < found[:, 0]) & (found[:, 0] < 5 * found[:, 1]))


def test_a_contact_may_become_stiffer_on_its_mesh():
    """Raise the stiffness on a given mesh.

    A fit of a rigid contact does the same.
    """
    found, delay = behind_coulomb(1e11, 1e14)
    assert found < 10 * delay + ACCURACY


@pytest.mark.parametrize("law", [friction.Dahl, friction.LuGre])
def test_no_contact_runs_away_on_a_mesh_made_for_a_softer_one(law):
    """Integrate a run with a short last stroke.

    Too large a deflection would pull the mass back there.
    """
    ts, start = np.linspace(0, END, TIMES), (1.8e-3, 0.0)
    steps = mesh(machine(law(0.04, sigma0=1e12)), *start, half_cycles=6)
    rigid = np.asarray(simulate(machine(friction.Coulomb(0.04)), start[0], ts, accuracy=1e-12).x)
    for sigma0 in np.geomspace(1e12, 3e14, 33):
        found = np.asarray(on(steps, machine(law(0.04, sigma0=sigma0)), *start, ts))
        assert np.abs(found - rigid).max() < 1e-7


def test_the_phases_end_at_the_last_reversal():
    oscillator = machine(LAWS["LuGre"])
    whole = mesh(oscillator, 2e-3, 0.0)
    assert last_phase(whole) == pytest.approx(5 * np.pi, rel=1e-12)
    assert last_phase(mesh(oscillator, 2e-3, 0.0, half_cycles=3)) == pytest.approx(3 * np.pi, rel=1e-12)


def test_another_start_stretches_the_first_half_cycle_alone():
    steps = Mesh.of(np.array([0.5, 1.0, np.pi, 4.0, 2 * np.pi]), np.array([0.0, 0.1, 1.2]), 8)
    found = np.asarray(steps.begun_at(jnp.asarray(0.6 + 2 * np.pi)))
    assert found[0] == pytest.approx(0.6) and np.all(np.diff(found[: int(steps.n_phase) + 1]) > 0)
    np.testing.assert_array_equal(found[2:], steps.ends[2:])
