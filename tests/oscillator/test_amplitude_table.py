"""Half-cycles from a table over amplitude, against half-cycles integrated one by one."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import AbstractFriction, Coulomb, Stribeck, Tanh
from fricjax.oscillator import Hybrid, Oscillator, restoring, starting_state
from fricjax.oscillator.engines.hybrid import Span
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

M, K, C = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING
NEVER = 10**9


def rig(law: AbstractFriction, load: float, **options) -> Oscillator:
    return Oscillator(M, K, C, load, law, **options)


PENDULUM = Oscillator(0.01, 0.5, 2e-4, 0.4, Coulomb(0.02), drag=5e-5, restoring=restoring.Pendulum())
# Machine, start, smallest and largest turning points of the table, half-cycles to the stop, unit of length [m].
CASES = {
    "Coulomb": (rig(Coulomb(0.01), 1.89), (2e-3, 0.0), 1e-4, 2.1e-3, 80, 1.0),
    "Coulomb, ends in motion": (rig(Coulomb(0.01), 1.89), (2e-3, 0.0), 8e-4, 2.1e-3, NEVER, 1.0),
    "Stribeck and drag": (rig(Stribeck(0.01, 0.013, 5e-3), 1.89, drag=0.5), (2e-3, 0.0), 4e-4, 2.1e-3, NEVER, 1.0),
    "Tanh": (rig(Tanh(0.01, 1e-4), 1.89), (2e-3, 0.0), 8e-4, 2.1e-3, NEVER, 1.0),
    "cubic spring": (
        rig(Coulomb(0.01), 1.89, restoring=restoring.Cubic(3e7)), (2e-3, 0.0), 8e-4, 2.1e-3, NEVER, 1.0,
    ),
    "pendulum": (PENDULUM, (1.2, 0.0), 0.5, 1.5, NEVER, 1e3),
    "stop sooner than by its law": (rig(Coulomb(0.01), 1.89), (2e-3, 0.0), 1e-3, 2.1e-3, 12, 1.0),
    "stop later than by its law": (rig(Coulomb(0.05), 1.89), (6e-4, 0.0), 1.5e-4, 7e-4, 8, 1.0),
}  # fmt: skip


@eqx.filter_jit
def samples(engine: Hybrid, machine: Oscillator, start: tuple, count: jax.Array, ts: jax.Array) -> tuple:
    """Positions at `ts` and their derivatives in one direction.

    In this direction, every coefficient and the initial position grow by a tenth.
    """

    def run(at: Oscillator, x0: jax.Array) -> jax.Array:
        return engine.path(at, starting_state(at, x0, start[1]), count).sample(ts)[0]

    point = machine, start[0]
    return jax.jvp(run, point, jax.tree.map(lambda value: 0.1 * value, point))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_table_gives_the_half_cycles_that_are_integrated_one_by_one(name: str):
    machine, start, lowest, highest, half_cycles, unit = CASES[name]
    span, count = Span(np.asarray(lowest), np.asarray(highest)), jnp.asarray(half_cycles)
    # Cases of Coulomb's law differ only in numbers and share their programs.
    capacity = 128 if name.startswith(("Coulomb", "stop")) else 16
    ts = jnp.linspace(0, (10 if half_cycles == NEVER else half_cycles + 2) * np.pi * np.sqrt(float(
        machine.mass / machine.stiffness)), 1001)  # fmt: skip
    # Arrays are arguments, so that all cases share one program.
    machine, start = jax.tree.map(jnp.asarray, (machine, start))
    alone = samples(Hybrid(48, capacity), machine, start, count, ts)
    table = samples(Hybrid(48, capacity, span, 24), machine, start, count, ts)
    print(f"{name}: {np.max(np.abs(table[0] - alone[0])):.1e}, derivative {np.max(np.abs(table[1] - alone[1])):.1e}")
    np.testing.assert_allclose(table[0], alone[0], rtol=0, atol=1e-12 * unit)
    np.testing.assert_allclose(table[1], alone[1], rtol=0, atol=1e-10 * unit)


@pytest.mark.slow
def test_a_start_in_motion_is_not_in_the_table():
    machine, span = rig(Coulomb(0.01), 1.89), Span(np.asarray(8e-4), np.asarray(2.1e-3))
    machine, start = jax.tree.map(jnp.asarray, (machine, (1e-3, 0.12)))
    found = samples(Hybrid(48, 128, span, 24), machine, start, jnp.asarray(NEVER), jnp.linspace(0, 0.1, 1001))
    assert np.all(np.isnan(found[0]))
