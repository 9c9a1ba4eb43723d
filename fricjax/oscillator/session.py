"""What a process needs before its first array: JAX in double precision, and a folder that keeps compiled programs.

Compiling takes seconds, loading what an earlier process has compiled a tenth of that. Nothing is set before something
is computed.
"""

import contextlib
import functools
import os
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
from jax._src import compilation_cache
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from . import cache


def ready() -> None:
    """Make sure that JAX computes in double precision, and from the first time on keep what it compiles.

    In single precision a millimetre is resolved to a tenth of a nanometre at best. The folder of compiled programs is
    the one named by FRICJAX_CACHE_DIR ("off" for none), else that of the user; one that the user has given to JAX is
    left as it is.

    Raises:
        RuntimeError: double precision is off; the message says how to switch it on.

    Examples:
        >>> jax.config.update("jax_enable_x64", True)
        >>> ready()
    """
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "fricjax computes in double precision, and JAX is set to single. Switch it on before the first array: "
            'jax.config.update("jax_enable_x64", True), or set the environment variable JAX_ENABLE_X64=1.'
        )
    _keep_programs()


def cores() -> int:
    """How many cores this process may use: fewer than the machine has where it is held to some.

    Queues of clusters and `taskset` hold a process to some, and so do the local workers of an archive.

    Examples:
        >>> cores() >= 1
        True
    """
    # What Python 3.13 calls os.process_cpu_count; macOS and Windows hold no process to cores in this way.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor() -> Any:
    """The device that fits compute on: the processor, also where JAX has found a GPU; None where JAX was denied it.

    A fit is some hundred steps of small arrays, each waiting for the one before it. On an H100 the first fit took two
    to three times as long, for its compiler, a warm one twice to four times, and a warm batch of Tanh 35 times.

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
    """Work of the host beside other threads that do the same, of which one computes while the others wait for XLA.

    Of Python only one runs at a time anyway. Left to themselves, threads hand it to each other at each call of NumPy,
    and two of them take a third longer than one for the same (1000 resampled records: 6.0 s, and in this way 4.6 s).

    Examples:
        >>> with one_at_a_time():
        ...     with waiting():
        ...         pass  # a compiled computation, or the compiler
    """
    with _HOST:
        _THREAD.holds = True
        try:
            yield
        finally:
            _THREAD.holds = False


@contextlib.contextmanager
def waiting() -> Iterator[None]:
    """Let another thread of the host work while this one waits for what holds no lock of the interpreter.

    Nobody who waits may hold another lock that somebody at work asks for.

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


@functools.cache
def _keep_programs() -> None:
    """Hand the folder to JAX, once in a process."""
    if jax.config.jax_compilation_cache_dir is not None:
        return
    folder = programs_folder()
    if folder is None:
        return
    cache.prune(folder)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # JAX neither notices damaged programs nor replaces them, so it is given a store that does. What was compiled before
    # has made up its mind that there is no folder.
    reset_cache()
    # JAX has no public way to name another store. Without this line all is kept, but damaged programs stay.
    if hasattr(compilation_cache, "_cache"):
        compilation_cache._cache = cache.Store(folder)


def programs_folder() -> Path | None:
    """Folder of compiled programs, made where it is missing.

    None where it is off, where it cannot be written to, or, with a warning, where another user might write to it.
    """
    folder = cache.asked_folder()
    if folder is None or not cache.made(folder):
        return None
    doubt = cache.distrust(folder)
    if doubt is not None:
        warnings.warn(f"Compiled programs are neither kept nor loaded: {doubt}", stacklevel=1)
        return None
    return folder
