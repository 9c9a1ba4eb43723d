"""Outcome of reading one file: read, refused by fricjax, or a fault."""

import contextlib
import os
import resource
import signal
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fricjax import Rig, load_fit, read
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb

SECONDS, GIGABYTES = 5.0, 0.75
"""Limits for a file: CPU time, and memory in addition to the quarter of a GB of fricjax."""
_PATIENCE = 30.0  # seconds after which a reader that only waits is stopped
_LONGEST_SENTENCE = 2000


class Outcome(NamedTuple):
    """Outcome of reading one file.

    Attributes:
        end: "read", the name of an exception, or the name of a fault such as "slow".
        words: message of the exception.
        seconds: CPU time.
        gigabytes: largest additional memory.
    """

    end: str
    words: str
    seconds: float
    gigabytes: float

    @property
    def sound(self) -> bool:
        """Return True if this outcome is allowed."""
        return self.end in ("read", "DataError", "UsageError")


def use(path: Path) -> None:
    """Read a file and call all methods that print it."""
    if path.suffix == ".toml":
        rig = Rig.from_toml(path)
        rig.summary(), rig.oscillator(Coulomb(0.1))
    elif path.suffix == ".json":
        fit = load_fit(path)
        fit.summary(), fit._repr_html_(), fit.to_dict(), repr(fit)
    else:
        record = read(path)
        record.summary(), record._repr_html_()


def attempt(path: Path) -> Outcome:
    """Read one file and measure its CPU time and additional memory.

    Both include the reading process of binary formats.
    """
    _forget_peak()
    begin, before = _cpu(), _peak()
    end, words = "read", ""
    try:
        with _limit(), warnings.catch_warnings():
            warnings.simplefilter("error")
            use(path)
    except (DataError, UsageError) as error:
        end, words = "UsageError" if isinstance(error, UsageError) else "DataError", str(error)
        wanted = UsageError if path.suffix == ".toml" else DataError
        if not isinstance(error, wanted) or path.name not in words:
            end = "wrong words"
        # A file with several runs lists them below the sentence.
        sentence, _, runs = words.partition("\n")
        if (runs and " runs; " not in sentence) or max(len(sentence), len(runs)) > _LONGEST_SENTENCE:
            end = "no sentence"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        end, words = type(error).__name__, str(error)[:200]
    took, grown = _cpu() - begin, _peak() - before
    if took > SECONDS:
        end = "slow"
    elif grown > GIGABYTES:
        end = "large"
    return Outcome(end, words, took, grown)


class _TooSlow(BaseException):
    """Time limit exceeded.

    It is no `Exception`, so that no reader treats it as damage of the file.
    """


@contextlib.contextmanager
def _limit() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise _TooSlow

    signal.signal(signal.SIGALRM, stop)
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_REAL, _PATIENCE)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)


def _processes() -> list[str]:
    """List this process and its children in `/proc`."""
    children = [task.read_text().split() for task in Path("/proc/self/task").glob("*/children")]
    return ["self", *(number for numbers in children for number in numbers)]


def _cpu() -> float:
    """Return the CPU time of this process and its children [s]."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    running = 0.0
    for number in _processes()[1:]:
        with contextlib.suppress(OSError):
            fields = Path(f"/proc/{number}/stat").read_text().rsplit(")")[1].split()
            running += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return time.process_time() + ended.ru_utime + ended.ru_stime + running


def _forget_peak() -> None:
    for number in _processes():
        with contextlib.suppress(OSError):
            Path(f"/proc/{number}/clear_refs").write_text("5")


def _peak() -> float:
    """Return the largest memory of a process since the last reset [GB].

    A child that has ended since then does not count; its limits bound its memory.
    """
    peaks = []
    for number in _processes():
        with contextlib.suppress(OSError, IndexError):
            peaks.append(int(Path(f"/proc/{number}/status").read_text().split("VmHWM:")[1].split()[0]) / 1e6)
    return sum(peaks) or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def limit_memory(extra: float) -> None:
    """Limit the address space to `extra` GB more than now.

    A file that unpacks without limit then fails before the machine runs out of memory.
    """
    state = Path("/proc/self/statm")
    if state.is_file():
        pages = int(state.read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (pages + int(extra * 1e9),) * 2)
