"""Progress line on stderr for computations that take longer than a second.

The line is rewritten in place and erased at the end. A computation opens a task. Nested tasks, in any thread, share the
line. A separate thread draws it as long as the outermost task lasts, so neither the computation nor compiled code is
involved.
"""

import contextlib
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from typing import Any

PROGRESS_VARIABLE = "FRICJAX_PROGRESS"
_OFF, _ON = ("0", "off", "no", "false"), ("1", "on", "yes", "true")
# Seconds before the line appears: it must not flicker when the result takes less than a second.
PATIENCE = 1.0
# Seconds between two updates: if the line can be overwritten, and if every line remains, as in the log of a job.
_REDRAWN, _LOGGED = 0.2, 10.0
# Number of nested tasks that fit into a line.
_SHOWN = 3
# Seconds before an estimate of the remaining time is useful.
_TELLING = 2.0
# JAX reports the start of a compilation only with a compilation cache, which the first fit switches on.
_BEGUN, _LOADED = "/jax/compilation_cache/compile_requests_use_cache", "/jax/compilation_cache/cache_hits"
_COMPILED = "/jax/core/compile/backend_compile_duration"


class Task:
    """A piece of work.

    Attributes:
        text: description, such as "Fitting".
        total: number of parts; None if the parts cannot be counted.
        done: number of finished parts.
        detail: further information, such as "3 failed".
    """

    def __init__(self, text: str, total: int | None = None) -> None:
        self.text, self.total, self.done, self.detail, self.begun = text, total, 0, "", time.perf_counter()

    def advance(self, parts: int = 1) -> None:
        """Count finished parts."""
        self.done += parts

    def words(self) -> str:
        """Text of the task for the line."""
        count = f"{self.done} of {self.total}" if self.total else ""
        return ": ".join(filter(None, [self.text, ", ".join(filter(None, [count, self.detail]))]))

    def left(self, now: float) -> str:
        """Estimate of the remaining time as text, or an empty string."""
        elapsed = now - self.begun
        if not (self.total and 0 < self.done < self.total and elapsed > _TELLING):
            return ""
        return f"about {elapsed / self.done * (self.total - self.done):.0f} s left"


def line_of(tasks: Iterable[Task], compiling: bool, now: float) -> str:
    """Compose the line for nested tasks.

    Args:
        tasks: the tasks, the outermost first.
        compiling: whether JAX is compiling.
        now: time of `time.perf_counter` [s].

    Examples:
        >>> from fricjax.show.working import Task, line_of
        >>> task = Task("Fitting runs", total=40)
        >>> task.advance(10)
        >>> line_of([task], compiling=True, now=task.begun + 12)
        'Fitting runs: 10 of 40, compiling, 12 s, about 36 s left'
    """
    first, *others = tasks
    texts = [first.words(), *(["compiling"] if compiling else [])]
    inner = [words for words in dict.fromkeys(task.words() for task in others) if words not in texts]
    texts[1:1] = inner[: _SHOWN - len(texts)]
    shown = f"{texts[0]}: {texts[1]}" if len(texts) > 1 and not first.total else ", ".join(texts[:2])
    return ", ".join(filter(None, [shown, *texts[2:], f"{now - first.begun:.0f} s", first.left(now)]))


class _Line:
    """The open tasks, and the thread that draws their line on stderr."""

    def __init__(self) -> None:
        self.asked: bool | None = None
        self._lock = threading.RLock()
        self._tasks: list[Task] = []
        self._compiling: set[int] = set()
        self._ended, self._thread = threading.Event(), None
        self._drawn, self._heard = 0, False

    def on(self) -> bool:
        """Return True if the line is shown."""
        asked = from_environment() if self.asked is None else self.asked
        return asked is True or (asked is None and self._redraws())

    def _redraws(self) -> bool:
        """Return True if stderr is a terminal or a notebook."""
        notebook = type(sys.stderr).__module__.startswith("ipykernel")
        with contextlib.suppress(AttributeError, ValueError):  # there is no stderr, or it is closed
            return notebook or (sys.stderr.isatty() and os.environ.get("TERM") != "dumb")
        return False

    def enter(self, task: Task) -> None:
        with self._lock:
            self._tasks.append(task)
            if self._thread is None and self.on():
                self._ended = threading.Event()
                self._thread = threading.Thread(target=self._draw, args=(self._ended,), daemon=True)
                self._thread.start()

    def leave(self, task: Task) -> None:
        with self._lock:
            self._tasks.remove(task)
            if self._tasks or self._thread is None:
                return
            thread, self._thread = self._thread, None
            self._ended.set()
        thread.join()

    def _draw(self, ended: threading.Event) -> None:
        redraws, wait = self._redraws(), PATIENCE
        self._listen(True)
        while not ended.wait(wait):
            with self._lock:
                if self._tasks and not ended.is_set():
                    self._listen(True)
                    self._write(line_of(self._tasks, bool(self._compiling), time.perf_counter()), redraws)
            wait = _REDRAWN if redraws else _LOGGED
        with self._lock:
            self.erase()
            self._listen(False)

    def _write(self, text: str, redraws: bool) -> None:
        text = "".join(sign if sign.isprintable() else "?" for sign in text)
        text = text.encode("ascii", "backslashreplace").decode()
        if redraws:
            text = text[: shutil.get_terminal_size().columns - 1]
            text, self._drawn = f"\r{text:<{self._drawn}}", len(text)
        with contextlib.suppress(AttributeError, OSError, ValueError):
            sys.stderr.write(text if redraws else f"{text}\n")
            sys.stderr.flush()

    def erase(self) -> None:
        """Erase the line for other output; it is drawn again later."""
        with self._lock:
            if self._drawn:
                blank, self._drawn = " " * self._drawn, 0
                with contextlib.suppress(AttributeError, OSError, ValueError):
                    sys.stderr.write(f"\r{blank}\r")
                    sys.stderr.flush()

    def _listen(self, to_it: bool) -> None:
        """Register or unregister listeners for compilations, once JAX is imported."""
        monitoring = sys.modules.get("jax.monitoring")
        if to_it == self._heard or not hasattr(monitoring, "unregister_event_duration_listener"):
            return
        self._heard = to_it
        # Other code may have cleared all listeners of JAX, and these with them.
        with contextlib.suppress(AssertionError, ValueError):
            if to_it:
                monitoring.register_event_listener(self._event)  # pyright: ignore[reportOptionalMemberAccess]
                monitoring.register_event_duration_secs_listener(self._duration)  # pyright: ignore[reportOptionalMemberAccess]
            else:
                monitoring.unregister_event_listener(self._event)  # pyright: ignore[reportOptionalMemberAccess]
                monitoring.unregister_event_duration_listener(self._duration)  # pyright: ignore[reportOptionalMemberAccess]

    def _event(self, event: str, **_: Any) -> None:
        if event == _BEGUN:
            self._compiling.add(threading.get_ident())
        elif event == _LOADED:
            self._compiling.discard(threading.get_ident())

    def _duration(self, event: str, *_: Any, **__: Any) -> None:
        if event == _COMPILED:
            self._compiling.discard(threading.get_ident())


_LINE = _Line()
erase = _LINE.erase


@contextlib.contextmanager
def working(text: str, total: int | None = None) -> Iterator[Task]:
    """Show a progress line during the body of a ``with``.

    Args:
        text: description, such as "Fitting".
        total: number of parts; None if they cannot be counted.

    Returns:
        The task, which counts the finished parts.

    Examples:
        >>> from fricjax.show.working import working
        >>> with working("Fitting runs", total=3) as task:
        ...     task.advance()
        >>> task.done
        1
    """
    task = Task(text, total)
    _LINE.enter(task)
    try:
        yield task
    finally:
        _LINE.leave(task)


def progress(on: bool | None) -> contextlib.ExitStack:
    """Switch the progress line of long computations on or off.

    The setting is permanent, or lasts for the body of a ``with``.

    Args:
        on: True: always show the line (if stderr is a file, a new line every ten seconds). False: never. None: show it
            on a terminal and in a notebook, unless the environment variable FRICJAX_PROGRESS is "on" or "off".

    Returns:
        A context manager that restores the previous setting at its end.

    Examples:
        >>> import fricjax as fj
        >>> with fj.progress(False):
        ...     pass  # no progress line
    """
    before, _LINE.asked = _LINE.asked, on
    stack = contextlib.ExitStack()
    stack.callback(setattr, _LINE, "asked", before)
    return stack


def from_environment() -> bool | None:
    """Setting of the environment variable; None if it is not set."""
    word = os.environ.get(PROGRESS_VARIABLE, "").strip().lower()
    return True if word in _ON else False if word in _OFF else None
