"""Cached programs: one trace for all processes, bounded number, no mix-up."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, Tanh
from fricjax.oscillator import Exact, Hybrid, Oscillator, Program, Start, simulate
from fricjax.oscillator.program import forget_programs

ONE, TWO = np.ones(3), np.ones(4)
# Class of the package that can hold any values.
holding: Any = Start


@pytest.fixture
def folder(tmp_path):
    before = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def counted(factor: float = 2.0) -> tuple[Callable[..., Any], list[int]]:
    """Return a new function and the list of its traces."""
    traces: list[int] = []

    def doubled(start: Any) -> Any:
        traces.append(1)
        return start._replace(x0=factor * start.x0)

    doubled.__module__ = "fricjax.oscillator.nowhere"
    return doubled, traces


def start(x: Any, state: Any = 0.0) -> Any:
    return holding(x, np.zeros(2), np.asarray(state))


def same(start: Any) -> Any:
    return start


def traced(folder) -> list:
    return sorted(folder.glob("fricjax-traced-*"))


def test_what_one_process_has_traced_another_one_runs(folder):
    for again in (False, True):
        function, traces = counted()
        program = Program(function, same)
        for _ in range(2):
            found = program(start(ONE))
            assert isinstance(found, Start) and np.array_equal(found.x0, 2 * ONE)
        assert len(traces) == (0 if again else 1)
    assert len(traced(folder)) == 1


def test_each_shape_and_each_class_has_its_own(folder):
    function, traces = counted()
    program = Program(function, same)
    laws = [Coulomb(0.1), Coulomb(0.1, 0.2)]
    for x, law in ((ONE, laws[0]), (TWO, laws[0]), (ONE.astype(np.float32), laws[0]), (ONE, laws[1])):
        given = holding(x, law, np.zeros(0))
        found = program(given)
        assert np.array_equal(found.x0, 2 * x) and found.x0.dtype == x.dtype
        assert jax.tree.structure(found) == jax.tree.structure(given)
    assert len(traces) == len(traced(folder)) == 4


@pytest.mark.parametrize(
    "law", [Coulomb(0.05), pytest.param(Tanh(0.05, 1e-3), marks=pytest.mark.slow)], ids=["Coulomb", "Tanh"]
)
def test_a_later_process_traces_no_motion_again(folder, law, monkeypatch):
    machine, ts = Oscillator(1.0, 5000.0, 1.0, 9.81, law), np.linspace(0.0, 0.3, 31)
    forget_programs()
    before = simulate(machine, 2e-3, ts)
    forget_programs()
    for engine in (Exact, Hybrid):
        monkeypatch.setattr(engine, "solve", None)
    again = simulate(machine, 2e-3, ts)
    assert jax.tree.structure(again) == jax.tree.structure(before)
    jax.tree.map(np.testing.assert_array_equal, again, before)
    assert len(traced(folder)) == 1


def test_a_program_is_compiled_beside_what_its_caller_does():
    begun, go_on = threading.Event(), threading.Event()
    function, traces = counted()

    def slowly(x: Any) -> Any:
        begun.set()
        assert go_on.wait(60)
        return function(x)

    program = Program(slowly, same)
    program.compile_beside(start(ONE))
    assert begun.wait(60) and not program.is_compiled(start(ONE))
    go_on.set()
    assert np.array_equal(program(start(3 * ONE)).x0, 6 * ONE)
    assert program.is_compiled(start(ONE)) and not program.is_compiled(start(TWO))
    assert len(traces) == 1


def test_what_is_wrong_with_a_program_compiled_beside_its_call_tells():
    def wrong(x: Any) -> Any:
        raise ValueError("no such motion")

    program = Program(wrong, same)
    program.compile_beside(start(ONE))
    with pytest.raises(ValueError, match="no such motion"):
        program(start(ONE))


def test_classes_of_others_are_compiled_but_not_kept(folder):
    class Start(NamedTuple):
        x0: Any

    for _ in range(2):
        function, traces = counted()
        assert np.array_equal(Program(function, same)(Start(ONE)).x0, 2 * ONE)
        assert len(traces) == 1
    function, _ = counted()
    function.__module__ = __name__
    Program(function, same)(start(ONE))
    assert not traced(folder)


def test_nothing_is_kept_while_jax_looks_for_nan(folder):
    function, traces = counted()
    with jax.debug_nans(True):
        assert np.array_equal(Program(function, same)(start(ONE)).x0, 2 * ONE)
    assert len(traces) == 1 and not traced(folder)


@pytest.mark.parametrize("damage", [lambda data: data[:-5], lambda data: b"", lambda data: data[:-1] + b"x"])
def test_a_damaged_file_is_made_again(folder, damage):
    Program(counted()[0], same)(start(ONE))
    (file,) = traced(folder)
    file.write_bytes(damage(file.read_bytes()))
    for again in (False, True):
        function, traces = counted()
        assert np.array_equal(Program(function, same)(start(ONE)).x0, 2 * ONE)
        assert len(traces) == (0 if again else 1)
    assert traced(folder) == [file]


def test_a_structure_that_is_not_that_of_the_result_is_refused(folder):
    with pytest.raises(TypeError, match="doubled returns"):
        Program(counted()[0], lambda start: (start, start))(start(ONE))


def test_the_programs_used_last_are_held():
    function, traces = counted()
    function.__module__ = __name__
    program = Program(function, same, most=2)
    for x, compiled in ((ONE, 1), (TWO, 2), (ONE, 2), (np.ones(5), 3), (ONE, 3), (TWO, 4)):
        program(start(x))
        assert len(traces) == compiled
    forget_programs()
    program(start(TWO))
    assert len(traces) == 5


def test_threads_compile_once(folder):
    function, traces = counted()
    program = Program(function, same)
    crowd = [threading.Thread(target=program, args=(start(ONE),)) for _ in range(8)]
    for each in crowd:
        each.start()
    for each in crowd:
        each.join()
    assert len(traces) == 1


def test_a_program_is_part_of_a_larger_one():
    program = Program(counted()[0], same)
    slope = jax.grad(lambda x: jnp.sum(program(start(x)).x0 ** 2))(jnp.asarray(ONE))
    assert np.array_equal(slope, 8 * ONE)


def test_a_program_that_calls_lapack_does_so_from_its_file_too(folder):
    matrix, right = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([1.0, 2.0])
    for _ in range(2):
        solved = lambda start: start._replace(x0=jnp.linalg.solve(start.v0, start.x0))
        solved.__module__ = "fricjax.oscillator.nowhere"
        found = Program(solved, same)(holding(right, matrix, np.zeros(0)))
        assert np.asarray(found.x0) == pytest.approx(np.linalg.solve(matrix, right))
    assert len(traced(folder)) == 1


def test_fits_compute_on_the_processor_wherever_else_arrays_are_made():
    """Use the second of two CPU devices to represent a GPU."""
    code = """
import jax
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_default_device", jax.devices()[1])
import jax.numpy as jnp
from fricjax.oscillator import Program
twice = Program(lambda x: 2 * x, like=lambda x: x)
print(jnp.ones(2).device.id, *(twice(x).device.id for x in (jnp.ones(2), jnp.ones(2).__array__())))
"""
    devices = {"XLA_FLAGS": "--xla_force_host_platform_device_count=2", "FRICJAX_CACHE_DIR": "off"}
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | devices
    )
    assert ended.stdout.split() == ["1", "0", "0"]
