"""Execution of chunks by threads of this process, or by Dask workers.

Both are pools of :mod:`concurrent.futures`, so one loop serves them. Workers read the files and return rows, and only
this process writes them. If a worker is lost, another one repeats its chunk. If a chunk kills its workers, its files
run alone; a file that still kills its worker gets the status failed.

Dask transmits Python objects: access to its ports allows running arbitrary code. Connections between local processes
are therefore encrypted with keys known only to them. A running scheduler is as safe as its configuration.
"""

import contextlib
import dataclasses
import itertools
import logging
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import jax

from .. import __version__
from ..errors import UsageError, needed
from ..oscillator import cores
from .plan import Chunk
from .work import Done, Work, outcome_of

type Executor = Callable[[Sequence[Chunk], Work], Generator[tuple[Chunk, Done]]]

# Chunks queued per worker thread, so that it need not wait. If a worker dies, all of its chunks are suspects.
_AHEAD = 2
# Workers that may die of a chunk before it is split. The default of Dask is three, but each costs seconds.
_ALLOWED = 1
_ANSWERS, _STARTS = 10.0, 60.0
"""Seconds to wait for an answer of a scheduler, and for its first worker."""
_DIED = {
    "status": "failed",
    "outcome": "The process that read and fitted it died each time, also while nothing else was at work. It may need "
    "more memory than there is: try it alone with fricjax fit.",
}
_GUARD = (
    "New processes import the script that starts them; put its code under if __name__ == '__main__':, or use the "
    "command fricjax batch."
)


def in_this_process(chunks: Sequence[Chunk], work: Work) -> Generator[tuple[Chunk, Done]]:
    """Process chunks by threads, so that reading files overlaps with fitting."""
    threads = cores()
    with ThreadPoolExecutor(threads) as pool:
        # One chunk more than threads keeps them busy; more would let results pile up behind a slow disk.
        yield from _results(pool, lambda: threads + 1, chunks, work)


def workers(number: int) -> Executor:
    """Return an executor with local worker processes.

    The processes live as long as there are chunks.

    Args:
        number: number of processes, each using one core. Without workers, a single process uses all cores. A script
            must call this under ``if __name__ == "__main__":``, because new processes import it.

    Raises:
        UsageError: Dask is not installed, or the number is not positive; when execution starts, also if the processes
            cannot be started.

    Examples:
        >>> workers(0)
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: There must be one worker at least, but workers=0 was given.
    """
    if number < 1:
        raise UsageError(f"There must be one worker at least, but workers={number} was given.")
    # Each new process imports the main module of this one and would start workers again.
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise UsageError(_GUARD)
    return _by_dask(number)


def scheduler(address: str) -> Executor:
    """Return an executor with the workers of a running scheduler.

    All workers must see the same files.

    Args:
        address: address of the scheduler, such as "tcp://192.168.0.1:8786".

    Raises:
        UsageError: Dask is not installed; when execution starts, also if no scheduler or no worker answers.

    Examples:
        >>> scheduler("nowhere")
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: 'nowhere' is no address of a scheduler; write it as tcp://192.168.0.1:8786.
    """
    if not re.fullmatch(r"\w+://.+:\d+", address):
        raise UsageError(f"{address!r} is no address of a scheduler; write it as tcp://192.168.0.1:8786.")
    return _by_dask(address)


def attempt(work: Work, chunk: Chunk) -> Done:
    """Process a chunk; an unexpected error gives failed rows."""
    # A worker process starts in single precision.
    jax.config.update("jax_enable_x64", True)
    try:
        return work(chunk)
    except Exception as error:
        return work.unfitted(chunk, outcome_of(error))


def _results(
    pool: Any, room: Callable[[], int], chunks: Sequence[Chunk], work: Work, death: tuple[type[Exception], ...] = ()
) -> Generator[tuple[Chunk, Done]]:
    """Yield the result of each chunk, in any order.

    At most `room()` chunks are in the pool. An exception of `death` means that a chunk killed its workers.
    """
    suspects: list[Chunk] = []
    for chunk, done in _completed(pool, room, chunks, work, death):
        if done is None:
            suspects += [(job,) for job in chunk]
        else:
            yield chunk, done
    for chunk, done in _completed(pool, lambda: 1, suspects, work, death):
        yield chunk, done or work.unfitted(chunk, _DIED)


def _completed(
    pool: Any, room: Callable[[], int], chunks: Sequence[Chunk], work: Work, death: tuple[type[Exception], ...]
) -> Generator[tuple[Chunk, Done | None]]:
    """Yield each chunk with its result, None if it killed its workers.

    After Ctrl-C no further chunk enters the pool, and those in it are still completed.
    """
    rest, interrupt = iter(chunks), None
    flying: dict[Future[Done], Chunk] = {}
    try:
        while True:
            for chunk in itertools.islice(rest, max(0, room() - len(flying))):
                flying[pool.submit(attempt, work, chunk)] = chunk
            if not flying:
                break
            try:
                ended = wait(flying, return_when=FIRST_COMPLETED).done
            except KeyboardInterrupt as error:
                if interrupt is not None:
                    raise
                rest, interrupt = iter(()), error
                continue
            for future in ended:
                chunk, done = flying.pop(future), None
                with contextlib.suppress(*death):
                    done = future.result()
                yield chunk, done
        if interrupt is not None:
            raise interrupt
    finally:
        for future in flying:
            future.cancel()


def _by_dask(where: int | str) -> Executor:
    """Return an executor with local workers, or those of a scheduler."""
    for module in ("cryptography", "distributed"):
        needed("A batch with workers", module, "batch")

    def execute(chunks: Sequence[Chunk], work: Work) -> Generator[tuple[Chunk, Done]]:
        from distributed.scheduler import KilledWorker

        if not chunks:
            return
        # Workers have another current folder, and do not need the list of all files.
        files = None if work.study.files is None else ()
        study = dataclasses.replace(work.study, root=work.study.root.resolve(), files=files)
        with _connected(where) as client:
            _check_workers(client, study.root)
            pool = client.get_executor(pure=False)
            # Workers may join and leave.
            room = lambda: _AHEAD * max(1, sum(client.ncores().values()))
            try:
                yield from _results(pool, room, chunks, dataclasses.replace(work, study=study), (KilledWorker,))
            except (OSError, CancelledError) as error:
                raise UsageError(
                    "The scheduler of the workers is gone. Finished chunks are kept: restart it, then repeat this "
                    "batch."
                ) from error

    return execute


@contextlib.contextmanager
def _connected(where: int | str) -> Iterator[Any]:
    """Connect to a scheduler with at least one worker."""
    from distributed import Client
    from distributed.utils import silence_logging_cmgr

    # This package reports the loss of the scheduler, once.
    with contextlib.ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))
        target = where if isinstance(where, str) else stack.enter_context(_local_cluster(where))
        try:
            client = stack.enter_context(Client(target, timeout=_ANSWERS, set_as_default=False))
        except (OSError, TimeoutError, ValueError) as error:
            raise UsageError(f"No scheduler answers at {where}. Start one: dask scheduler.") from error
        try:
            client.wait_for_workers(1, timeout=_STARTS)
        except TimeoutError as error:
            raise UsageError(
                f"The scheduler at {where} has no workers. Start some: dask worker {where} --nworkers 2 --nthreads 1 "
                f"--preload {__name__}"
            ) from error
        yield client


def _local_cluster(number: int) -> Any:
    from dask import config
    from distributed import LocalCluster

    # These processes do not need an HTTP interface.
    routes = {f"distributed.{kind}.http.routes": [] for kind in ("scheduler", "worker")}
    try:
        with config.set(routes):
            return LocalCluster(
                n_workers=number,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                worker_dashboard_address="127.0.0.1:0",
                security=True,
                silence_logs=logging.CRITICAL,
                preload=__name__,
                scheduler_kwargs={"allowed_failures": _ALLOWED},
            )
    except RuntimeError as error:
        raise UsageError(f"The workers did not start ({error}). {_GUARD}") from error


def dask_setup(worker: Any) -> None:
    """Prepare a worker started with ``--preload fricjax.archive.execute``.

    Dask calls this function. The worker ignores Ctrl-C, which reaches all processes of a terminal; the driver handles
    it and waits for running chunks. Local workers are bound to one core each.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Only a local cluster numbers its workers. Without affinity each worker would start as many threads as there are
    # cores; XLA counts the cores when it starts.
    number = getattr(worker, "name", None)
    if isinstance(number, int) and hasattr(os, "sched_setaffinity"):
        usable = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {usable[number % len(usable)]})


def _worker_facts(root: str) -> tuple[str, bool]:
    """Return a worker's package version, and whether it sees a folder."""
    return __version__, Path(root).is_dir()


def _check_workers(client: Any, root: Path) -> None:
    """Refuse workers with another version, or without access to the runs."""
    try:
        answers = client.run(_worker_facts, str(root))
    except ImportError as error:
        raise UsageError(
            f"A worker cannot import fricjax ({error}). Start it in the environment of this one."
        ) from error
    for address, (version, sees) in answers.items():
        if version != __version__:
            raise UsageError(
                f"The worker {address} has fricjax {version}, and this is {__version__}. Update one of them."
            )
        if not sees:
            raise UsageError(f"The worker {address} does not see {root}. Put the runs where all workers find them.")
