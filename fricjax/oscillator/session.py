"""What a process needs before its first array: JAX in double precision, and a folder that keeps compiled programs.

Compiling takes seconds, loading what an earlier process has compiled a tenth of that. The folder belongs to the user
alone, for what lies in it is executed; its size is bounded; and nothing is set before something is computed.
"""

import functools
import os
import platform
import zlib
from pathlib import Path

import jax
from jax.experimental.compilation_cache.compilation_cache import reset_cache

CACHE_VARIABLE = "FRICJAX_CACHE_DIR"
_OFF = ("", "off", "none", "0")
# The programs of all laws together are a few hundred megabytes. What is too much goes when a process begins, and some
# more with it, so that not each of them has to.
_LARGEST, _KEPT = 1 << 30, 0.8


def ready() -> None:
    """Make sure that JAX computes in double precision, and from the first time on keep what it compiles.

    In single precision a millimetre is resolved to a tenth of a nanometre at best. The folder of compiled programs is
    the one named by FRICJAX_CACHE_DIR ("off" for none), else that of the user; one that the user has given to JAX is
    left as it is.

    Raises:
        RuntimeError: double precision is off; the message says how to switch it on.
    """
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "fricjax computes in double precision, and JAX is set to single. Switch it on before the first array: "
            'jax.config.update("jax_enable_x64", True), or set the environment variable JAX_ENABLE_X64=1.'
        )
    _keep_programs()


@functools.cache
def _keep_programs() -> None:
    """Hand the folder to JAX, once in a process."""
    if jax.config.jax_compilation_cache_dir is not None:
        return
    folder = programs_folder()
    if folder is None:
        return
    _prune(folder)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # What was compiled before has made up its mind that there is no folder.
    reset_cache()


def programs_folder() -> Path | None:
    """Folder of compiled programs, made where it is missing.

    None where it is off, where it cannot be written to, or where another user might write to it.
    """
    named = os.environ.get(CACHE_VARIABLE)
    if named is not None and named.strip().lower() in _OFF:
        return None
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    folder = (Path(named).expanduser() if named else home / "fricjax") / _processor()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Raises where the folder is not ours.
        folder.chmod(0o700)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


def _processor() -> str:
    """A short name for this kind of processor: in a shared folder, code for another one must not be loaded."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        features = next(line for line in lines if line.lower().startswith(("flags", "features")))
    except (OSError, StopIteration):
        features = platform.processor()
    return f"{platform.machine()}-{zlib.crc32(features.encode()):08x}"


def _prune(folder: Path, largest: int = _LARGEST) -> None:
    """Let the programs go that were not used for the longest time, where all together are larger than `largest` bytes.

    Another process may do the same at the same time, so that a file may be gone.
    """
    files = []
    for path in folder.iterdir():
        try:
            files.append((path.stat(), path))
        except OSError:
            continue
    size = sum(found.st_size for found, _ in files)
    if size <= largest:
        return
    for found, path in sorted(files, key=lambda each: max(each[0].st_atime, each[0].st_mtime)):
        if size <= _KEPT * largest:
            return
        path.unlink(missing_ok=True)
        size -= found.st_size
