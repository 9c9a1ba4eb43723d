"""Output files of a command: early checks, and pictures."""

import errno
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError

if TYPE_CHECKING:
    from .options import Writing

PICTURES = (".png", ".svg", ".pdf")
RECORDS = (".npz", ".csv", ".h5", ".hdf5")
RESULTS = (".json",)


def write_picture(
    output: "Writing", plot: Path | None, draw: Callable[[], Any], name: str = "picture"
) -> dict[str, str]:
    """Write a picture to `plot`, and return its path by name."""
    if plot is None:
        return {}
    from ..show import save

    return {name: str(save(draw(), plot, overwrite=output.force))}


def write_pictures(output: "Writing", plot: Path | None, draws: Sequence[Callable[[], Any]]) -> dict[str, str]:
    """Write a picture of each run, numbered if there are several."""
    written: dict[str, str] = {}
    for i, path in enumerate(numbered(plot, len(draws))):
        written |= write_picture(output, path, draws[i], "picture" if len(draws) == 1 else f"picture_{i + 1}")
    return written


def check_targets(output: "Writing", *targets: tuple[str, Path | None, tuple[str, ...]]) -> None:
    """Refuse output files that cannot be written, before any work is done.

    Args:
        output: options for the output; existing files are replaced only with ``--force``.
        *targets: for each file the name of its option, its path or None, and the allowed suffixes.

    Raises:
        UsageError: a wrong suffix, a missing folder, an existing file, or two options with the same file.
        OSError: a folder without write permission.
    """
    # A fit can take minutes, so check the names before it starts.
    named = [(option, path, suffixes) for option, path, suffixes in targets if path is not None]
    for option, path, suffixes in named:
        if path.suffix.lower() not in suffixes:
            raise UsageError(f"{option} cannot write '{path}': give it the ending {' or '.join(suffixes)}.")
        if not path.parent.is_dir():
            raise UsageError(f"{option} cannot write '{path}': there is no folder '{path.parent}'. Make it first.")
        if path.is_dir():
            raise UsageError(f"{option} cannot write '{path}': that is a folder.")
        if path.exists() and not output.force:
            raise UsageError(f"{option} cannot write '{path}': it exists already. Add --force, or give another name.")
        check_folder(path.resolve().parent, path)
    if len({path.absolute() for _, path, _ in named}) < len(named):
        raise UsageError(f"{' and '.join(option for option, _, _ in named)} name the same file. Give each its own.")


def check_folder(folder: Path, path: Path) -> None:
    """Refuse a path in a folder without write permission.

    Raises:
        OSError: the folder is not writable.
    """
    if not os.access(folder, os.W_OK):
        from ..show.files import refused

        raise refused(errno.EACCES, path)


def numbered(path: Path | None, count: int) -> list[Path]:
    """Return one path per run, numbered if there are several runs."""
    if path is None:
        return []
    return [path] if count == 1 else [path.with_stem(f"{path.stem}-{i + 1}") for i in range(count)]
