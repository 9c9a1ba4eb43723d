"""Progress: what lasts longer than a second says so on stderr, in one line that is rewritten and taken away at the end.

Whoever works opens a task; tasks within tasks, in whatever threads, share the line. It is drawn by a thread that lives
as long as the outermost task, so that nothing is drawn by those who work, and compiled code knows nothing of it.
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
# Seconds before the first word: who gets an answer within one wants no line that flickers.
PATIENCE = 1.0
# Seconds between two lines where one can be drawn over, and where each stays, as in the log of a job.
_REDRAWN, _LOGGED = 0.2, 10.0
# Tasks within tasks that still fit into a line.
_SHOWN = 3
# Seconds and parts done before which the time that is left is a guess of no use.
_TELLING = 2.0
# JAX says when it begins to compile only where it keeps what it compiles, which is so from the first fit on.
_BEGUN, _LOADED = "/jax/compilation_cache/compile_requests_use_cache", "/jax/compilation_cache/cache_hits"
_COMPILED = "/jax/core/compile/backend_compile_duration"


class Task:
    """A piece of work.

    Attributes:
        text: what is done, as "Fitting".
        total: number of its parts; None where it has none that could be counted.
        done: how many of them are done.
        detail: more of how it goes, as "3 failed".
    """

    def __init__(self, text: str, total: int | None = None) -> None:
        self.text, self.total, self.done, self.detail, self.begun = text, total, 0, "", time.perf_counter()

    def advance(self, parts: int = 1) -> None:
        """Count parts that are done."""
        self.done += parts

    def words(self) -> str:
        """What is shown of it."""
        count = f"{self.done} of {self.total}" if self.total else ""
        return ": ".join(filter(None, [self.text, ", ".join(filter(None, [count, self.detail]))]))

    def left(self, now: float) -> str:
        """When it will be done, where that can be said."""
        elapsed = now - self.begun
        if not (self.total and 0 < self.done < self.total and elapsed > _TELLING):
            return ""
        return f"about {elapsed / self.done * (self.total - self.done):.0f} s left"


def line_of(tasks: Iterable[Task], compiling: bool, now: float) -> str:
    """The line of some tasks, the outermost first, at a time of `time.perf_counter`.

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
    """The line on stderr: which tasks are open, and the thread that draws them."""

    def __init__(self) -> None:
        self.asked: bool | None = None
        self._lock = threading.RLock()
        self._tasks: list[Task] = []
        self._compiling: set[int] = set()
        self._ended, self._thread = threading.Event(), None
        self._drawn, self._heard = 0, False

    def on(self) -> bool:
        """Whether anything is shown: as asked, else on a terminal and in a notebook."""
        asked = from_environment() if self.asked is None else self.asked
        return asked is True or (asked is None and self._redraws())

    def _redraws(self) -> bool:
        """Whether stderr is a terminal or the cell of a notebook, where a line can be drawn over."""
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
        """Take the line away, for what others write; it comes again."""
        with self._lock:
            if self._drawn:
                blank, self._drawn = " " * self._drawn, 0
                with contextlib.suppress(AttributeError, OSError, ValueError):
                    sys.stderr.write(f"\r{blank}\r")
                    sys.stderr.flush()

    def _listen(self, to_it: bool) -> None:
        """Hear of JAX when it compiles, for as long as something is shown; it may be imported meanwhile."""
        monitoring = sys.modules.get("jax.monitoring")
        if to_it == self._heard or not hasattr(monitoring, "unregister_event_duration_listener"):
            return
        self._heard = to_it
        # Who clears all listeners of JAX clears these as well.
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
    """Say that something is being done, for as long as it takes.

    Args:
        text: what is done, as "Fitting".
        total: number of parts, where they can be counted.

    Returns:
        The task, to count the parts that are done.

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
    """Switch the progress line of long computations on or off, for good or for the length of a ``with``.

    Args:
        on: True: show it wherever stderr leads, in a file as a line every ten seconds; False: never; None: on a
            terminal and in a notebook, unless the environment variable FRICJAX_PROGRESS says "on" or "off".

    Returns:
        A context, at whose end all is as before.

    Examples:
        >>> import fricjax as fj
        >>> with fj.progress(False):
        ...     pass  # nothing here says how far it is
    """
    before, _LINE.asked = _LINE.asked, on
    stack = contextlib.ExitStack()
    stack.callback(setattr, _LINE, "asked", before)
    return stack


def from_environment() -> bool | None:
    """What the environment variable asks for; None where it asks for nothing."""
    word = os.environ.get(PROGRESS_VARIABLE, "").strip().lower()
    return True if word in _ON else False if word in _OFF else None
