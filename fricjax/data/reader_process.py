"""A separate process that opens files with the libraries of their formats.

A damaged or malicious file can crash a library, occupy it forever, or unpack to far more than its size. The libraries
therefore run in a child process with limits on memory and processor time. The child chooses the columns and sends their
names and numbers as JSON and plain float64, never as objects. It does not import JAX. Each thread that reads files has
one such process, which ends with the thread.
"""

import contextlib
import importlib
import json
import math
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from ..errors import DataError, UsageError, quoted
from .files import NUMBER, allowance, gigabytes, library
from .native import damaged
from .readers.choice import Choice
from .readers.choose import Samples, samples_of
from .readers.sheet import SINGLE, Column

# Data memory of the child with all libraries loaded; 154 MB were measured. With four times the smallest allowance (the
# numbers as stored, as float64, and unpacking buffers) a small file stays below 1 GB.
_LIBRARIES, _COPIES = 1 << 28, 4
# Processor time. openpyxl is the slowest library and takes 1 s for a MB; a slower machine gets 2.5 times as much.
# The limit does not grow beyond the size that a workbook of a million rows has.
_SECONDS, _SECONDS_PER_BYTE, _LARGEST = 3, 2.5e-6, 10**8
# Waiting time per processor time, for machines with many busy processes.
_BUSY = 10
_ERRORS = {"DataError": DataError, "UsageError": UsageError}


class Format(NamedTuple):
    """A binary format.

    **Fields:**

    - `module`: module of `fricjax.data.readers` with a context manager `open_sheet(path, choice, **options)`.
    - `kind`: the format, for messages.
    - `name`: the format in `Record.meta`.
    - `library`: optional library that reads it, with the extra of this package that installs it.
    - `options`: names of the options of the format.
    """

    module: str
    kind: str
    name: str
    library: tuple[str, str] | None = None
    options: tuple[str, ...] = ()


class Content(NamedTuple):
    """The chosen content of a file.

    **Fields:**

    - `runs`: the chosen columns of each run.
    - `record`: arrays and texts of a record from `fricjax.write`, None for other files.
    """

    runs: list[Samples]
    record: tuple[dict[str, np.ndarray], dict[str, str]] | None


def read_content(path: Path, file_format: Format, choice: Choice, options: dict[str, Any]) -> Content:
    """Read a file in the reading process of this thread.

    Raises:
        DataError: a damaged file, one that exceeds the limits, or one without the chosen columns.
        UsageError: an option that does not fit, or the library of the format is not installed.
    """
    while True:
        reader = _reader()
        alone, reader.files = reader.files == 0, reader.files + 1
        try:
            return reader.read(path, file_format, choice, options)
        except _Slow:
            words = f"this takes more than {_seconds(path):.0f} s"
            break
        except _Crashed as error:
            words = f"the library for this format crashed ({error})"
            # An earlier file may have damaged the memory of the process, so try again in a new one.
            if alone:
                break
    raise DataError(f"{path.name} cannot be read as {file_format.kind}: {words}; it is damaged or of another format.")


class _Slow(Exception):
    """The reading process exceeded its time."""


class _Crashed(Exception):
    """The reading process ended before it answered."""


_STORE = threading.local()


def _reader() -> "_Reader":
    """Return the reading process of this thread."""
    reader = getattr(_STORE, "reader", None)
    # A forked process must not share the pipes of its parent.
    if reader is None or reader.owner != os.getpid() or reader.process.poll() is not None:
        reader = _STORE.reader = _Reader()
    return reader


class _Reader:
    """A reading process.

    `owner` is the process that started it, and `files` the number of its files.
    """

    def __init__(self) -> None:
        self.owner, self.files = os.getpid(), 0
        code = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from {0} import serve; serve()"
        # One thread for linear algebra, because each takes memory.
        self.process = subprocess.Popen(
            [sys.executable, "-c", code.format(__name__), json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self._requests, self._replies = self.process.stdin, self.process.stdout
        _widen(self._replies)
        weakref.finalize(self, _end, self.process, self.owner)

    def read(self, path: Path, file_format: Format, choice: Choice, options: dict[str, Any]) -> Content:
        """Read a file; see `read_content`."""
        seconds = _seconds(path)
        common = {name: value for name, value in vars(choice).items() if name != "sigma"}
        request = {"path": os.path.abspath(path), "format": file_format, "choice": common, "options": options}
        reply, arrays = self._ask(request, seconds)
        if reply["record"] is not None:
            return Content([], (dict(zip(reply["names"], arrays, strict=True)), reply["record"]))
        numbers, runs = iter(arrays), []
        for i, (x, clock, rate, others) in enumerate(reply["runs"]):
            place = lambda sample, run=i: self._ask({"place": (run, sample)}, seconds)[0]["place"]
            values, times = next(numbers), None if clock is None else next(numbers)
            runs.append(Samples(Column(*x), values, clock and Column(*clock), times, place, rate, tuple(others)))
        return Content(runs, None)

    def _ask(self, request: dict[str, Any], seconds: float) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Send a request and return the answer with its arrays."""
        try:
            self._requests.write(json.dumps(request, default=_plain).encode() + b"\n")
            self._requests.flush()
            if hasattr(select, "poll"):  # not on Windows
                waiting = select.poll()
                waiting.register(self._replies, select.POLLIN)
                if not waiting.poll(1000 * _BUSY * seconds):
                    raise _Slow
            if not (line := self._replies.readline()):
                raise EOFError
            reply = json.loads(line)
            arrays = [np.empty(size) for size in reply["sizes"]]
            for array in arrays:
                if self._replies.readinto(array) < array.nbytes:  # pyright: ignore[reportAttributeAccessIssue]
                    raise EOFError
        except BaseException as error:
            # Also after Ctrl-C, since the rest of the answer would be taken for that of the next request.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(1.0 if isinstance(error, EOFError | OSError) else 0.0)
            self.process.kill()
            code = self.process.wait()
            if not isinstance(error, OSError | EOFError | ValueError):
                raise
            if code == -getattr(signal, "SIGXCPU", 0):
                raise _Slow from error
            raise _Crashed(signal.Signals(-code).name if code < 0 else f"exit code {code}") from error
        if "error" in reply:
            raise _ERRORS[reply["error"]](reply["text"])
        return reply, arrays


def _end(process: subprocess.Popen[bytes], owner: int) -> None:
    """End a reading process by closing its input."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    if owner == os.getpid():
        process.wait()


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else list(value)


def _widen(pipe: IO[bytes]) -> None:
    """Enlarge a pipe, so that the child waits less often."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, 1 << 20)


def _seconds(path: Path) -> float:
    """Return the largest processor time for a file [s]."""
    return _SECONDS + _SECONDS_PER_BYTE * min(path.stat().st_size, _LARGEST)


def serve() -> None:
    """Answer the requests on standard input until it closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which closes the pipe
    # Libraries print to standard output.
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    runs: list[Samples] = []
    for line in sys.stdin.buffer:
        request, arrays = json.loads(line), list[np.ndarray]()
        if "place" in request:
            run, sample = request["place"]
            reply: dict[str, Any] = {"place": runs[run].place(sample)}
        else:
            path, file_format = Path(request["path"]), Format(*request["format"])
            try:
                reply, arrays, runs = _answer(path, file_format, Choice(**request["choice"]), request["options"])
            except Exception as error:
                reply = _refusal(error, path.name, file_format.kind)
        replies.write(json.dumps({**reply, "sizes": [array.size for array in arrays]}).encode() + b"\n")
        for array in arrays:
            replies.write(memoryview(array))
        replies.flush()


def _answer(
    path: Path, file_format: Format, choice: Choice, options: dict[str, Any]
) -> tuple[dict[str, Any], list[np.ndarray], list[Samples]]:
    """Return the reply for a file, its arrays, and the runs."""
    # An import under the limit of the file before it could end the process.
    _limit(None)
    if file_format.library is not None:
        library(path, *file_format.library)
    module = importlib.import_module(f".readers.{file_format.module}", __package__)
    _limit(path)
    with module.open_sheet(path, choice, **options) as sheet:
        if sheet.record is not None:
            runs, names = [], [column.name for column in sheet.columns]
            for column in sheet.columns:
                if column.fault not in (None, SINGLE):
                    raise damaged(path.name, f"'{column.name}' {column.fault}")
            arrays = sheet.load(sheet.columns)
        else:
            runs = samples_of(sheet, choice, path.name)
            names = [each.x.name for each in runs]
            arrays = [numbers for each in runs for numbers in (each.values, each.times) if numbers is not None]
    size = NUMBER * sum(array.size for array in arrays)
    if size > allowance(path):
        raise DataError(
            f"{quoted(names)} in {path.name} is not read: it has {gigabytes(size)}, more than plausible for a file of "
            "this size."
        )
    fields = [
        (_fields(each.x), each.time and _fields(each.time), each.rate, [_printable(name) for name in each.others])
        for each in runs
    ]
    reply = {"record": None if runs else sheet.record, "names": names, "runs": fields}
    return reply, [np.ascontiguousarray(array, dtype=np.float64).ravel() for array in arrays], runs


def _refusal(error: Exception, name: str, kind: str) -> dict[str, Any]:
    if isinstance(error, DataError | UsageError):
        # The path of a node can have thousands of characters.
        text = re.sub(r"\S{200,}", lambda word: f"{word[0][:100]}...", _printable(str(error)))
        return {"error": "UsageError" if isinstance(error, UsageError) else "DataError", "text": text}
    if isinstance(error, MemoryError):
        text = f"{name} cannot be read as {kind}: it needs more memory than plausible for a file of this size."
    else:
        # Libraries raise many other exceptions for damaged files.
        words = _printable(" ".join(str(error).split()))[:120] or type(error).__name__
        text = f"{name} cannot be read as {kind} ({words}); it is damaged or of another format."
    return {"error": "DataError", "text": text}


def _limit(path: Path | None) -> None:
    """Limit memory and processor time for one file; None lifts the limits."""
    with contextlib.suppress(ImportError):  # Windows has no such limits
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        memory, seconds = (math.inf, math.inf) if path is None else (allowance(path), _seconds(path))
        for limit, most in (
            (resource.RLIMIT_DATA, _LIBRARIES + _COPIES * memory),
            (resource.RLIMIT_CPU, time.process_time() + seconds),
        ):
            hard = resource.getrlimit(limit)[1]
            largest = math.inf if hard == resource.RLIM_INFINITY else hard
            resource.setrlimit(limit, (hard if most >= largest else math.ceil(most), hard))


def _fields(column: Column) -> tuple[Any, ...]:
    return tuple(text and _printable(text) for text in (column.name, column.unit, column.run, column.title))


def _printable(text: str) -> str:
    """Replace control characters, except line breaks, by escapes."""
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
