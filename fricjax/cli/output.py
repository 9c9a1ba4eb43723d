"""Where results go: text or JSON on stdout, the log on stderr, files that appear complete or not at all."""

import contextlib
import json
import math
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .options import Output

PICTURES = (".png", ".svg", ".pdf")
RECORDS = (".npz", ".csv", ".h5", ".hdf5")
RESULTS = (".json",)
PATIENCE = 2.0


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays become lists, what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def json_text(value: Mapping[str, Any]) -> str:
    """A mapping as JSON that every parser accepts."""
    return json.dumps(plain(value), indent=2, ensure_ascii=False, allow_nan=False)


def finish(output: "Output", data: Mapping[str, Any], text: str) -> None:
    """Tell the outcome on stdout: `data` as JSON where that was asked for, else `text`."""
    sys.stdout.write((json_text(data) if output.json else text) + "\n")
    sys.stdout.flush()


def log(output: "Output", text: str) -> None:
    """One line on stderr, unless JSON or quiet was asked for."""
    if not (output.json or output.quiet):
        sys.stderr.write(f"{text}\n")


@contextlib.contextmanager
def working(output: "Output", text: str) -> Iterator[None]:
    """Show that work goes on: a spinner on a terminal, else a line once the work takes longer than two seconds."""
    if output.json or output.quiet:
        yield
        return
    started = time.perf_counter()
    with _spinner(text) if sys.stderr.isatty() else _late_line(text):
        yield
    elapsed = time.perf_counter() - started
    if elapsed > PATIENCE:
        log(output, f"{text}: done in {elapsed:.1f} s")


@contextlib.contextmanager
def _spinner(text: str) -> Iterator[None]:
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(text, total=None)
        yield


@contextlib.contextmanager
def _late_line(text: str) -> Iterator[None]:
    import threading

    timer = threading.Timer(PATIENCE, lambda: sys.stderr.write(f"{text} ...\n"))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def check_targets(*targets: tuple[str, Path | None, tuple[str, ...]]) -> None:
    """Refuse, before any work is done, files that could not be written at its end.

    Args:
        *targets: for each file the name of its option, its path or None, and the suffixes that it may have.

    Raises:
        UsageError: a suffix that does not fit, a folder that does not exist, or two files in one place.
    """
    from ..data.errors import UsageError

    named = [(option, path, suffixes) for option, path, suffixes in targets if path is not None]
    for option, path, suffixes in named:
        if path.suffix.lower() not in suffixes:
            raise UsageError(f"{option} cannot write '{path}': give it the ending {' or '.join(suffixes)}.")
        if not path.parent.is_dir():
            raise UsageError(f"{option} cannot write '{path}': there is no folder '{path.parent}'. Make it first.")
        if path.is_dir():
            raise UsageError(f"{option} cannot write '{path}': that is a folder.")
    if len({path.absolute() for _, path, _ in named}) < len(named):
        raise UsageError(f"{' and '.join(option for option, _, _ in named)} name the same file. Give each its own.")


def numbered(path: Path, count: int) -> list[Path]:
    """One path per run: the path itself, or with a number for each of several."""
    return [path] if count == 1 else [path.with_stem(f"{path.stem}-{i + 1}") for i in range(count)]
