"""Process settings: double precision, folder of compiled programs, device, threads.

Compiling takes seconds; loading a program that an earlier process has compiled takes a tenth of that. The package
changes no setting before its first computation.
"""

import contextlib
import functools
import os
import sys
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

from . import cache

_STARTED: dict[str, int] = {}


def ready() -> None:
    """Check that JAX computes in double precision, and keep compiled programs.

    Single precision resolves a millimetre to a tenth of a nanometre at best. The first call sets the folder of compiled
    programs: the one that FRICJAX_CACHE_DIR names ("off" for none), else the user's cache folder. A folder that the
    user has given to JAX stays as it is.

    Raises:
        RuntimeError: double precision is off, or the process was forked from one that has used JAX; the message gives
            the remedy.

    Examples:
        >>> jax.config.update("jax_enable_x64", True)
        >>> ready()
    """
    # The threads of JAX do not exist in a forked process, which would wait for them forever.
    if _STARTED.setdefault("process", os.getpid()) != os.getpid():
        raise RuntimeError(
            "This process was forked from one that had used JAX, and JAX does not survive a fork. Start processes with "
            "multiprocessing.get_context('spawn'), or fork before the first computation."
        )
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "fricjax computes in double precision, and JAX is set to single. Switch it on before the first array: "
            'jax.config.update("jax_enable_x64", True), or set the environment variable JAX_ENABLE_X64=1.'
        )
    _keep_programs()


def cores() -> int:
    """Return the number of cores that this process may use.

    Job queues, `taskset` and the local workers of an archive limit a process to some of the cores.

    Examples:
        >>> cores() >= 1
        True
    """
    # os.process_cpu_count needs Python 3.13; macOS and Windows have no such limit.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor() -> Any:
    """Return the device that computes fits.

    It is the CPU, or None if JAX may not use the CPU.

    A fit is a chain of some hundred steps on small arrays. On an H100 the first fit took two to three times as long as
    on the CPU because of the compiler, a warm fit two to four times, and a warm batch of Tanh 35 times.

    Examples:
        >>> processor().platform
        'cpu'
    """
    try:
        return jax.local_devices(backend="cpu")[0]
    except RuntimeError:
        return None


_HOST = threading.Lock()
_THREAD = threading.local()


@contextlib.contextmanager
def one_at_a_time() -> Iterator[None]:
    """Run the Python part of a fit in one thread.

    BLAS gets one thread too. Other threads run during `waiting`. Without this lock, threads switch at each call of
    NumPy, and two of them take a third longer than one for the same work (1000 resampled records: 6.0 s, with the lock
    4.6 s).

    Examples:
        >>> with one_at_a_time():
        ...     with waiting():
        ...         pass  # a compiled computation, or the compiler
    """
    with one_blas_thread(), _HOST:
        _THREAD.holds = True
        try:
            yield
        finally:
            _THREAD.holds = False


@contextlib.contextmanager
def waiting() -> Iterator[None]:
    """Release the lock of `one_at_a_time` during a wait for compiled code.

    Do not hold another lock while waiting: that can deadlock.

    Examples:
        >>> with one_at_a_time(), waiting():
        ...     pass
    """
    if not getattr(_THREAD, "holds", False):
        yield
        return
    _THREAD.holds = False
    _HOST.release()
    try:
        yield
    finally:
        _HOST.acquire()
        _THREAD.holds = True


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread.

    Fits solve small systems. A least-squares problem of 2000 x 6 takes 0.09 ms with one thread and up to 24 ms with two
    on a busy machine, because threads of BLAS wait for one another. threadpoolctl lets the first of several threads
    that ask set the limit.

    Examples:
        >>> with one_blas_thread():
        ...     pass
    """
    # SciPy brings a second library. If a fit loads it, the limit applies from the next fit on.
    with _blas_libraries("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas"):
        yield


@functools.cache
def _blas_libraries(scipy: bool) -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@functools.cache
def _keep_programs() -> None:
    """Give the folder of compiled programs to JAX, once in a process."""
    if jax.config.jax_compilation_cache_dir is not None:
        return
    folder = programs_folder()
    if folder is None:
        return
    cache.prune(folder)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # JAX has no public way to name another store. If one of these names moves, JAX keeps programs in its own store,
    # which does not replace damaged ones.
    with contextlib.suppress(ImportError):
        from jax._src import compilation_cache
        from jax.experimental.compilation_cache.compilation_cache import reset_cache

        # A program that was compiled before has made JAX decide that there is no folder.
        reset_cache()
        if hasattr(compilation_cache, "_cache"):
            compilation_cache._cache = cache.Store(folder)


def programs_folder() -> Path | None:
    """Return the folder of compiled programs; create it if needed.

    None if it is off or cannot be written to. None with a warning if another user could write to it.
    """
    folder = cache.asked_folder()
    if folder is None or not cache.made(folder):
        return None
    doubt = cache.distrust(folder)
    if doubt is not None:
        warnings.warn(f"Compiled programs are neither kept nor loaded: {doubt}", stacklevel=1)
        return None
    return folder
