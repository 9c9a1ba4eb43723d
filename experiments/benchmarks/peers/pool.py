"""Fits of an archive by one peer, in one process per core.

The processes stay alive, so that only the fits are timed.
"""

import importlib
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from record import Record, load

from peers.least_squares import Outcome

CORES = os.cpu_count() or 1
CHUNK = 5
_records: list[Record] = []


def _open(path: Path, peer: str) -> None:
    """Load the records in a worker, and compile the peer there."""
    _records.extend(load(path))
    _fit_some(peer, [0])


def _fit_some(peer: str, runs: list[int]) -> list[Outcome]:
    module = importlib.import_module(peer)
    return [module.fit(_records[run]) for run in runs]


@contextmanager
def _environment(**settings: str) -> Iterator[None]:
    """Set environment variables for new processes.

    The processes read them at the import of numpy.
    """
    before = dict(os.environ)
    os.environ.update(settings)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


class Pool:
    """Workers that hold the records of a file.

    Workers are new interpreters, because a fork of a process that runs JAX may hang. Each has one thread, so that
    workers do not compete for cores.
    """

    def __init__(self, path: Path, peer: str, runs: int) -> None:
        self.peer = peer
        self.chunks = [list(range(i, min(i + CHUNK, runs))) for i in range(0, runs, CHUNK)]
        self.workers = ProcessPoolExecutor(CORES, get_context("spawn"), _open, (path, peer))
        with _environment(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1"):
            self.workers.submit(_fit_some, peer, [0]).result()

    def __call__(self) -> list[Outcome]:
        found = self.workers.map(_fit_some, [self.peer] * len(self.chunks), self.chunks)
        return [outcome for some in found for outcome in some]

    def close(self) -> None:
        self.workers.shutdown()
