"""Programs of few kernels have the results of their functions."""

import os
import re
import subprocess
import sys

import jax
import jax.numpy as jnp
import jaxlib.version
import numpy as np
import pytest

from fricjax.oscillator import kernels as module
from fricjax.oscillator import program
from fricjax.oscillator.kernels import OPTIONS, in_few_kernels
from fricjax.oscillator.program import Program
from tests.tiers import cases

X = np.linspace(0.1, 2.0, 60)


def sorted_waves(x):
    return jnp.sort(jnp.sin(9 * x)) * 2 + 1


FUNCTIONS = {
    "elementwise": lambda x: jnp.exp(-x) * jnp.sin(x) + jnp.tanh(x) ** 3 / jnp.cbrt(1 + x),
    "sums": lambda x: (jnp.cumsum(x) / jnp.sum(x), jnp.argmax(jnp.sin(x)), jnp.any(x > 1)),
    "parts": lambda x: jnp.concatenate([x[::-1][3:], x[2:5] * 2]).reshape(3, -1).T,
    "searched": lambda x: jnp.interp(x + 0.05, x, x**2) + x[jnp.searchsorted(x, 0.7 * x)],
    "choice": lambda x: jax.lax.cond(x[0] > 0.5, lambda a: a * 2, lambda a: jnp.cos(a) + 1, x),
    "loop": lambda x: jax.lax.fori_loop(0, 5, lambda i, s: s.at[i + 1].set(s[i] * 2 + s[0]), x),
    "until": lambda x: jax.lax.while_loop(lambda s: jnp.sum(s) < 500, lambda s: s * 1.1 + 1, x),
    "derivative": lambda x: jax.jacfwd(lambda a: jnp.sin(a) * jnp.sum(a**2) + jnp.max(a))(x),
    "batch": lambda x: jax.vmap(lambda a: jax.lax.fori_loop(0, 3, lambda _, s: s * a + 1, a))(x),
    "matrix": lambda x: jnp.outer(x, x).T @ jnp.outer(x, x) + jnp.eye(60) * jnp.arange(60.0),
    "sorted": sorted_waves,
    "solved": lambda x: jnp.linalg.solve(jnp.diag(x[:5]) + 0.1, jnp.sin(x[:5])) * 3 - 1,
    "scattered": lambda x: jnp.zeros(60).at[jnp.arange(60) // 2].add(jnp.sin(x)) * 2,
    "nothing": lambda x: (x * 2 + 1, x[:0] * 3, jnp.sum(x[:0]) + x),
    "long": lambda x: jnp.sum(jnp.sin(jnp.tile(x, 200)) ** 2) + jnp.tile(x, 200)[-1],
    "the same": lambda x: (x, jnp.sin(x) + 1, x),
    "constants": lambda x: (jnp.arange(4.0) * 2 + 1, jnp.eye(3) @ jnp.ones(3), x * 1),
}


@pytest.mark.parametrize("name", cases(FUNCTIONS, ["elementwise", "choice", "loop", "until", "nothing"]))
def test_results_are_those_of_the_function(name):
    function = FUNCTIONS[name]
    few = jax.jit(in_few_kernels(function)).lower(X).compile(OPTIONS)(X)
    for one, other in zip(jax.tree.leaves(few), jax.tree.leaves(function(X)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("factor", [0.5, 2])
@pytest.mark.parametrize("constant", ["_MOST", "_LEAST", "_LONGEST", "_COPIED"])
def test_constants_decide_how_long_something_takes_and_no_result(constant, factor, monkeypatch):
    def steps(x):
        part = jax.lax.fori_loop(0, 5, lambda i, s: s.at[2 * i + 1].set(s[i] * 2 + jnp.sum(jnp.sin(s))), jnp.tile(x, 2))
        return jnp.cumsum(jnp.tanh(jnp.outer(part, x)), axis=0)[-1] / jnp.sum(x)

    monkeypatch.setattr(module, constant, int(factor * getattr(module, constant)))
    few = jax.jit(in_few_kernels(steps)).lower(X).compile(OPTIONS)(X)
    np.testing.assert_allclose(few, steps(X), rtol=1e-12)


def kernels(function) -> int:
    """Count the functions that the compiler generates for a program.

    These are the marked calls and all fusions outside of them.
    """
    text = jax.jit(function).lower(X).compile(OPTIONS).as_text() or ""
    bodies = dict(re.findall(r"^(?:ENTRY )?%([\w.\-]+) \(.*?\{\n(.*?)^\}", text, re.MULTILINE | re.DOTALL))
    marked = set(re.findall(r"to_apply=%([\w.\-]+), frontend_attributes=\{[^}]*xla_cpu_small_call", text))
    return len(marked) + sum(
        body.count(" fusion(") for name, body in bodies.items() if name not in marked and "fused" not in name
    )


def test_few_kernels_are_compiled():
    def steps(x):
        for _ in range(20):
            x = jnp.cumsum(jnp.sin(x)) / jnp.sum(x)
        return x

    assert kernels(steps) >= 40
    assert kernels(in_few_kernels(steps)) <= 3


@pytest.mark.parametrize("kept", [True, False])
def test_what_xla_refuses_in_a_kernel_is_compiled_without(kept, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_KNOWN", module._KNOWN | {"sort"})
    with pytest.raises(jax.errors.JaxRuntimeError, match="kernel"):
        jax.jit(in_few_kernels(sorted_waves)).lower(X).compile(OPTIONS)
    monkeypatch.setattr(program, "_is_ours", lambda _: kept)
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    try:
        np.testing.assert_allclose(Program(sorted_waves, lambda x: x)(X), np.sort(np.sin(9 * X)) * 2 + 1, rtol=1e-14)
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    assert any(path.name.startswith("fricjax-traced") for path in tmp_path.iterdir()) == kept


def waves(x):
    return jnp.sin(9 * x) * 2 + jnp.cos(x) / 3


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """Return a function that compiles a program and returns its cached bytes."""
    monkeypatch.setattr(program, "_is_ours", lambda _: True)
    before = jax.config.jax_compilation_cache_dir

    def compile_and_read():
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        jax.config.update("jax_compilation_cache_dir", str(folder))
        np.testing.assert_allclose(Program(waves, lambda x: x)(X), waves(X), rtol=1e-14)
        return b"".join(path.read_bytes() for path in folder.glob("fricjax-traced-*"))

    yield compile_and_read
    jax.config.update("jax_compilation_cache_dir", before)


MARK = b"xla_cpu_small_call"


def test_programs_are_marked_with_the_tried_jaxlib_only(kept, monkeypatch):
    assert MARK in kept(), "this jaxlib was not tried: see CONTRIBUTING.md, Constraints"
    monkeypatch.setattr(jaxlib.version, "__version__", "0.12.1")
    assert MARK not in kept()


@pytest.mark.parametrize(("word", "marked"), [("off", False), ("on", True)])
def test_the_environment_switches_marks(word, marked, kept, monkeypatch):
    monkeypatch.setattr(jaxlib.version, "__version__", "0.12.0.1" if word == "off" else "0.12.1")
    monkeypatch.setenv("FRICJAX_KERNELS", word)
    assert (MARK in kept()) == marked


def test_a_program_kept_with_marks_is_not_used_without(tmp_path, monkeypatch):
    monkeypatch.setattr(program, "_is_ours", lambda _: True)
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    try:
        for word in ("on", "off"):
            monkeypatch.setenv("FRICJAX_KERNELS", word)
            Program(waves, lambda x: x)(X)
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    found = [MARK in path.read_bytes() for path in tmp_path.glob("fricjax-traced-*")]
    assert sorted(found) == [False, True]


MOVED = """
import os, sys
import jax, equinox, diffrax  # these may use the names that JAX moves
import jax.extend.core, jax.experimental.xla_metadata, jax.experimental.compilation_cache.compilation_cache as cache
if "marks" in sys.argv:
    sys.modules["jax.extend.core"] = None
    del jax.extend.core, jax.experimental.xla_metadata.xla_metadata_call
if "cache" in sys.argv:
    del cache.reset_cache
jax.config.update("jax_enable_x64", True)
import fricjax as fj
motion = fj.simulate(fj.Oscillator(1.0, 5000.0, 0.0, 9.81, fj.friction.Coulomb(0.1)), 3e-3, jax.numpy.array([0.5]))
print(float(motion.x[0]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("moved", ["marks", "cache"])
def test_a_name_that_jax_moves_is_not_needed(moved, tmp_path):
    environment = os.environ | {"FRICJAX_CACHE_DIR": str(tmp_path)}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    command = [sys.executable, "-W", "error", "-c", MOVED, moved]
    ran = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stderr
    assert abs(float(ran.stdout) + 0.1392e-3) < 1e-12


BEGIN = """
import jax, jax.numpy as jnp, numpy as np
from fricjax.oscillator.kernels import OPTIONS, in_few_kernels
"""
WITHOUT_USE = """
def f(x, k, c):
    # Simplification removes k and c.
    y = jnp.where(jnp.full(3, True), jnp.sin(x) * 2 + 1, k * x)
    return jnp.cos(y) - 0 * jnp.floor(jnp.isnan(c) * 0), y[:0] * k
"""
UNWANTED = """
def f(x, k, c):
    # Only a sort uses the first result of the kernel, and the result of the sort is unused. Only half of k is used.
    y, z = jnp.sin(x) * 2 + 1, jnp.cos(x) * jnp.stack([k, 3.0])[1] + c
    jnp.sort(y)
    return jnp.sort(z), z
"""
END = """
x = np.ones(3), np.asarray(2.0), np.arange(3)
print(jax.jit(in_few_kernels(f)).lower(*x).compile(OPTIONS)(*x)[0].shape)
"""


@pytest.mark.parametrize("function", [WITHOUT_USE, UNWANTED], ids=["arguments without use", "a result without use"])
def test_what_xla_does_not_expect_of_a_kernel_does_not_end_the_process(function):
    """Compile unused arguments, unused results and empty arrays."""
    ended = subprocess.run([sys.executable, "-c", BEGIN + function + END], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.strip()) == (0, "(3,)"), ended.stderr
