"""Progress: a delayed line that is rewritten and removed, and its thread."""

import io
import os
import pty
import subprocess
import sys
import threading
import time
import types

import jax
import pytest

import fricjax as fj
from fricjax.show import working as module
from fricjax.show.working import Task, line_of, working


class Terminal(io.StringIO):
    """Stream that reports to be a terminal."""

    def isatty(self):
        return True

    def screen(self):
        """Return the final text of the line, with carriage returns applied."""
        shown = ""
        for part in self.getvalue().split("\r"):
            shown = part + shown[len(part) :]
        return shown.rstrip(" ")


@pytest.fixture
def terminal(monkeypatch):
    stream = Terminal()
    # Pytest restores its stderr between a fixture and its test.
    monkeypatch.setattr(module, "sys", types.SimpleNamespace(stderr=stream, modules=sys.modules))
    monkeypatch.setattr(module, "PATIENCE", 0.05)
    monkeypatch.setattr(module, "_REDRAWN", 0.01)
    monkeypatch.delenv("FRICJAX_PROGRESS", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return stream


def until(condition, seconds=10.0):
    begun = time.perf_counter()
    while not condition() and time.perf_counter() - begun < seconds:
        time.sleep(0.005)
    assert condition()


def test_a_line_comes_is_rewritten_and_goes(terminal):
    before = threading.active_count()
    with working("Fitting runs", 3) as task:
        until(lambda: "Fitting runs: 0 of 3, 0 s" in terminal.getvalue())
        task.advance(2)
        until(lambda: terminal.screen().startswith("Fitting runs: 2 of 3"))
        assert "\n" not in terminal.getvalue()
    assert terminal.screen() == "" and threading.active_count() == before


def test_nothing_within_the_first_second(terminal, monkeypatch):
    monkeypatch.setattr(module, "PATIENCE", 1.0)
    with working("Fitting"):
        time.sleep(0.2)
    assert terminal.getvalue() == ""


def test_the_line_goes_and_the_thread_ends_when_the_work_fails(terminal):
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError), working("Dividing"):
        until(lambda: "Dividing" in terminal.getvalue())
        1 / 0  # noqa: B018
    assert terminal.screen() == "" and threading.active_count() == before


@pytest.mark.parametrize(
    ("asked", "named", "is_terminal", "shown"),
    [
        (None, None, True, True),
        (None, None, False, False),
        (None, "1", False, True),
        (None, "off", True, False),
        (False, "1", True, False),
        (True, "off", False, True),
    ],
)
def test_who_decides(terminal, monkeypatch, asked, named, is_terminal, shown):
    monkeypatch.setattr(terminal, "isatty", lambda: is_terminal)
    if named is not None:
        monkeypatch.setenv("FRICJAX_PROGRESS", named)
    with fj.progress(asked):
        assert module._LINE.on() is shown
    assert module._LINE.asked is None


def test_without_a_terminal_lines_stay(terminal, monkeypatch):
    monkeypatch.setattr(terminal, "isatty", lambda: False)
    with fj.progress(True), working("Fitting files", 40) as task:
        task.advance(10)
        until(terminal.getvalue)
    assert terminal.getvalue() == "Fitting files: 10 of 40, 0 s\n"


def test_tasks_share_one_line():
    outer, inner = Task("Comparing laws", 3), Task("compiling")
    outer.advance()
    at = outer.begun
    assert line_of([outer, inner], False, at + 8) == "Comparing laws: 1 of 3, compiling, 8 s, about 16 s left"
    assert line_of([Task("Fitting"), inner, inner], True, at + 3.2) == "Fitting: compiling, 3 s"
    outer.detail = "1 failed"
    assert line_of([outer], False, at + 1) == "Comparing laws: 1 of 3, 1 failed, 1 s"


def test_names_of_files_move_no_cursor(terminal):
    with working("Fitting a\x1b[31m\u202eb.csv"):
        until(terminal.getvalue)
    assert "\x1b" not in terminal.getvalue() and "\u202e" not in terminal.getvalue()


def test_compiling_is_named_as_such_while_jax_compiles_and_no_longer(terminal):
    began, end = threading.Event(), threading.Event()

    def compile_():
        jax.monitoring.record_event("/jax/compilation_cache/compile_requests_use_cache")
        began.set()
        end.wait(10)
        jax.monitoring.record_event_duration_secs("/jax/core/compile/backend_compile_duration", 1.0)

    with working("Simulating"):
        until(lambda: "Simulating" in terminal.screen())
        thread = threading.Thread(target=compile_)
        thread.start()
        until(lambda: terminal.screen().startswith("Simulating: compiling"))
        end.set()
        thread.join()
        until(lambda: terminal.screen().startswith("Simulating, "))
    count = len(jax._src.monitoring.get_event_listeners())  # pyright: ignore[reportAttributeAccessIssue]
    with working("Again"):
        pass
    assert len(jax._src.monitoring.get_event_listeners()) == count  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.slow
def test_a_compilation_of_jax_is_seen(tmp_path):
    # A new process with an empty cache on a terminal. Compilation takes longer than the reduced patience.
    code = """
import jax, jax.numpy as jnp
jax.config.update("jax_enable_x64", True)
import fricjax as fj, numpy as np
from fricjax.show import working as module
module.PATIENCE = module._REDRAWN = 0.01
fj.simulate(fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05)), 2e-3, np.linspace(0, 0.6, 99))
"""
    main, other = pty.openpty()
    kept = ("JAX_COMPILATION_CACHE_DIR", "FRICJAX_PROGRESS")
    environment = {name: value for name, value in os.environ.items() if name not in kept}
    environment |= {"FRICJAX_CACHE_DIR": str(tmp_path / "programs"), "TERM": "xterm"}
    done = subprocess.Popen([sys.executable, "-c", code], stderr=other, env=environment)
    os.close(other)
    read = b""
    try:
        while part := os.read(main, 4096):
            read += part
    except OSError:  # the other end is closed
        pass
    assert done.wait() == 0, read
    assert b"Simulating: compiling, " in read and read.endswith(b" \r") and b"\n" not in read
