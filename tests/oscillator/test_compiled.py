"""Hot loops are compiled as single kernels, without library calls.

XLA for the CPU compiles a loop as one marked call only if its body is small and calls no function. A loop with a few
passes over whole arrays, such as the quasilinear steps, gains nothing from that. It is a loop so that its body is
compiled once.
"""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, LuGre, Stribeck, Tanh
from fricjax.oscillator import Exact, Hybrid, Oscillator, Smooth, starting_state
from fricjax.oscillator.engines.hybrid import Span
from fricjax.oscillator.engines.smooth import Mesh
from tests.tiers import cases

SPAN = Span(np.asarray(3e-4), np.asarray(2.1e-3))
FEW = 5
# The tests read the programs and do not run them. Optimisation by LLVM would double the time without any effect here.
UNTOUCHED = {"xla_backend_optimization_level": 0}
MESH = Mesh.of(np.linspace(0, 20, 201), np.linspace(0, 2, 21), 221)
CASES = {
    "exact": (Exact(16), Coulomb(0.05), None),
    "half-cycles, Stribeck": (Hybrid(28, 16), Stribeck(0.05, 0.065, 5e-3), None),
    "half-cycles, Tanh": (Hybrid(28, 16), Tanh(0.05, 1e-4), None),
    "table, Stribeck": (Hybrid(28, 16, SPAN, 12), Stribeck(0.05, 0.065, 5e-3), 5),
    "table, Tanh": (Hybrid(28, 16, SPAN, 12), Tanh(0.05, 1e-4), 10**9),
    "mesh in phase, LuGre": (Smooth(mesh=MESH), LuGre(0.05, 0.065, 5e-3), None),
    "mesh in phase, Tanh": (Smooth(mesh=MESH), Tanh(0.05, 1e-3), None),
}


def compiled(name: str, derivatives: bool) -> str:
    """Text of the compiled samples of a path, or of their Jacobian."""
    engine, law, half_cycles = CASES[name]
    leaves, structure = jax.tree.flatten(Oscillator(0.41, 2574.0, 0.17, 9.66, law))
    ts = jnp.linspace(0, 0.2, 101)

    def samples(values: list[jax.Array], x0: jax.Array) -> jax.Array:
        machine = jax.tree.unflatten(structure, values)
        count = None if half_cycles is None else jnp.asarray(half_cycles)
        path = engine.path(machine, starting_state(machine, x0, 0.0), count)
        return path.sample(ts)[0]

    run = jax.jacfwd(samples) if derivatives else samples
    lowered = jax.jit(run).lower([jnp.asarray(leaf) for leaf in leaves], jnp.asarray(2e-3))
    return lowered.compile(UNTOUCHED).as_text() or ""


def loops(text: str) -> tuple[int, int]:
    """Count all loops and the long ones.

    A loop is long if it has more than a few passes or an unknown number.
    """
    lines = [line for line in text.splitlines() if " while(" in line]
    counts = [re.search(r'known_trip_count":{"n":"(\d+)"', line) for line in lines]
    return len(lines), sum(count is None or int(count[1]) > FEW for count in counts)


@pytest.mark.parametrize("derivatives", [False, True], ids=["motion", "derivatives"])
@pytest.mark.parametrize("name", cases(CASES, ["exact"]))
def test_hot_loops_are_one_kernel_each(name: str, derivatives: bool):
    text = compiled(name, derivatives)
    assert not re.findall(r'custom_call_target="([^"]*)"', text)
    every, hot = loops(text)
    assert hot <= text.count("xla_cpu_small_call") <= every
    assert (" while(" in text) == (name != "exact")


def test_a_loop_that_calls_a_library_would_be_seen():
    def loop(x: jax.Array) -> jax.Array:
        return jax.lax.fori_loop(0, 10, lambda _, y: jnp.linalg.solve(jnp.eye(3) + y[:, None] ** 2, y), x)

    text = jax.jit(loop).lower(jnp.ones(3)).compile().as_text() or ""
    assert "custom_call_target" in text
    assert text.count("xla_cpu_small_call") < loops(text)[0]
