"""Faults of laboratory runs, with the status and reason required for each."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.archive.formats import FORMATS, Writer, hdf5, rows
from experiments.archive.motion import WHITE


class Fault(NamedTuple):
    """A way to break a run.

    Attributes:
        ending: ending of the file.
        write: function that writes the broken file.
        status: required status of the run in the table.
        reason: regular expression for the reason in the table.
    """

    ending: str
    write: Writer
    status: str
    reason: str


def _cut(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    FORMATS["packed npz"][1](path, t, x)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _damaged(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """Overwrite 512 bytes in the middle, like one bad sector."""
    hdf5(path, t, x)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 512] = bytes(512)
    path.write_bytes(data)


def _volts(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    path.write_text("Time [s],Displacement [V]\n" + rows(t, 2e3 * x, "%.6f,%.7f\n"))


def _with(change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]], format: str) -> Writer:
    """Return a writer of an intact file of a changed run."""
    return lambda path, t, x: FORMATS[format][1](path, *change(t, x))


def _held(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return t, x[0] + WHITE * np.random.default_rng(t.size).standard_normal(t.size)


def _twice(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Repeat 100 samples in the middle, as in a buffer fault."""
    middle = t.size // 2
    return tuple(np.concatenate([values[:middle], values[middle - 100 :]]) for values in (t, x))  # pyright: ignore


def _kicked(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shift the later samples by 20 fringes, as after a lost count."""
    return t, x + np.where(np.arange(t.size) > t.size // 3, 20 * 316e-9, 0.0)


def _short(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut the run before the first reversal."""
    moving = int(np.argmax(np.abs(x - x[0]) > 0.3 * np.ptp(x)))
    return t[:moving], x[:moving]


_LOG = "The magnet did not let go, see page 17 of the notebook.\nTo be repeated on Monday.\n"
FAULTS: dict[str, Fault] = {
    "empty": Fault("csv", lambda path, t, x: path.touch(), "rejected", "is empty: it holds no data at all"),
    "cut": Fault("npz", _cut, "rejected", r"cannot be read as \.npz"),
    "damaged": Fault("h5", _damaged, "rejected", "cannot be read as HDF5|not of the size that they claim"),
    "constant": Fault("csv", _with(lambda t, x: (t, 0 * x + 1e-4), "comma"), "rejected", r"constant \(exactly"),
    "never released": Fault("h5", _with(_held, "HDF5"), "rejected", r"constant \(within its noise"),
    "no values": Fault("csv", _with(lambda t, x: (t, np.nan * x), "comma"), "rejected", r"Displacement.* is empty"),
    "volts": Fault("csv", _volts, "rejected", "is in V, which only a scale makes a displacement"),
    "text": Fault("txt", lambda path, t, x: path.write_text(_LOG), "rejected", "holds no rows of numbers"),
    "wrong ending": Fault("csv", hdf5, "rejected", "is binary, not text"),
    "times twice": Fault("txt", _with(_twice, "comments"), "rejected", "the time is not increasing"),
    "too short": Fault("npz", _with(_short, "npz"), "rejected", "holds no reversal"),
    "fringes lost": Fault("h5", _with(_kicked, "HDF5"), "invalid", "does not describe: "),
}
"""Faults by name."""
