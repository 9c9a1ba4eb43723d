"""What becomes of one file: read, refused in the package's own words, or something that must not be."""

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
"""What a file may take at most: time of computing, and memory beside the quarter of a GB of the package itself."""
_PATIENCE = 30.0  # seconds after which what neither computes nor ends is given up
_LONGEST_SENTENCE = 2000


class Outcome(NamedTuple):
    """How it ended: "read", the name of the exception, or what was exceeded; and the words that go with it."""

    end: str
    words: str
    seconds: float
    gigabytes: float

    @property
    def sound(self) -> bool:
        """Whether it is one of the ends that a file may have."""
        return self.end in ("read", "DataError", "UsageError")


def use(path: Path) -> None:
    """Reads a file and looks at what it holds, as a user would."""
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
    """The outcome of one file, with the time of computing that it took and the memory that was added at most."""
    _forget_peak()
    begin, before = time.process_time(), _peak()
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
        # Below the sentence stand the runs of a file that holds several.
        sentence, _, runs = words.partition("\n")
        if (runs and " runs; " not in sentence) or max(len(sentence), len(runs)) > _LONGEST_SENTENCE:
            end = "no sentence"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        end, words = type(error).__name__, str(error)[:200]
    took, grown = time.process_time() - begin, _peak() - before
    if took > SECONDS:
        end = "slow"
    elif grown > GIGABYTES:
        end = "large"
    return Outcome(end, words, took, grown)


class _TooSlow(BaseException):
    """No `Exception`, so that nobody takes it for damage of the file."""


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


def _forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak() -> float:
    """Largest memory of the process since it was forgotten [GB]."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1e6
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def limit_memory(extra: float) -> None:
    """Lets the process map so many more gigabytes than now, so that a bomb fails before the machine does."""
    state = Path("/proc/self/statm")
    if state.is_file():
        pages = int(state.read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (pages + int(extra * 1e9),) * 2)
