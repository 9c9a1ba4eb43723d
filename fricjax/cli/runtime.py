"""What a command does before its first array: double precision, a place for compiled code, warnings in one line."""

import os
import platform
import sys
import warnings
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .options import Output

CACHE_VARIABLE = "FRICJAX_CACHE_DIR"


def prepare(output: "Output") -> None:
    """Make jax ready: double precision on, compiled code kept between runs where that is possible."""
    _word_warnings(output)
    import jax

    jax.config.update("jax_enable_x64", True)
    folder = cache_folder()
    if folder is not None and jax.config.jax_compilation_cache_dir is None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def cache_folder() -> Path | None:
    """Folder for compiled code: FRICJAX_CACHE_DIR, else the user's cache; None where it is off or read-only."""
    named = os.environ.get(CACHE_VARIABLE)
    if named is not None and named.strip().lower() in ("", "off", "none", "0"):
        return None
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    folder = (Path(named) if named else home / "fricjax") / _processor()
    try:
        folder.mkdir(parents=True, exist_ok=True)
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


def _word_warnings(output: "Output") -> None:
    """Warnings of this package become one line each on stderr; those of its dependencies concern no user."""

    def show(message: Warning | str, category: Any, filename: str, *_: Any, **__: Any) -> None:
        if not output.quiet and "fricjax" in Path(filename).parts:
            sys.stderr.write(f"Warning: {' '.join(str(message).split())}\n")

    warnings.showwarning = show
