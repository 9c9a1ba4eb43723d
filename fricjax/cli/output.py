"""Where results go: text or JSON on stdout, the log on stderr, files that appear complete or not at all."""

import contextlib
import errno
import json
import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from .wording import in_options

if TYPE_CHECKING:
    from .options import Output, Writing

PICTURES = (".png", ".svg", ".pdf")
RECORDS = (".npz", ".csv", ".h5", ".hdf5")
RESULTS = (".json",)
PATIENCE = 2.0
# Control characters but tab and newline, marks that turn the direction of writing, halves of characters.
_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")
# Keys of an outcome under which sentences stand.
_SENTENCES = ("status", "warnings", "error", "notes", "remarks")


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


def json_text(value: Mapping[str, Any], *, ascii_only: bool = False) -> str:
    """A mapping as JSON that every parser accepts and no terminal obeys."""
    text = json.dumps(plain(value), indent=2, ensure_ascii=ascii_only, allow_nan=False)
    return _UNSEEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def tell(stream: TextIO, text: str) -> None:
    """Write lines of text to a stream, the one way by which text leaves the program.

    Names and cells of files may hold what a terminal would obey, and what its encoding does not know: both are written
    as escapes.
    """
    text = visible(text) + "\n"
    try:
        stream.write(text)
    except UnicodeEncodeError:
        encoding = stream.encoding or "ascii"
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding))


def tell_json(stream: TextIO, value: Mapping[str, Any]) -> None:
    """The same of one JSON object, which stays one in every encoding."""
    try:
        stream.write(json_text(value) + "\n")
    except UnicodeEncodeError:
        stream.write(json_text(value, ascii_only=True) + "\n")


def visible(text: str) -> str:
    """Text in which what would move the cursor, change colours or hide itself is an escape that can be seen."""
    return _UNSEEN.sub(lambda match: match[0].encode("unicode_escape", "surrogatepass").decode("ascii"), text)


def finish(output: "Output", data: Mapping[str, Any], text: str) -> None:
    """Tell the outcome on stdout: `data` as JSON where that was asked for, else `text`."""
    try:
        if output.json:
            tell_json(sys.stdout, reworded(data))
        else:
            tell(sys.stdout, in_options(text))
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        # What could not be written would be tried again when the process ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(error.errno, error.strerror, "stdout") from error


def deliver(
    output: "Writing", data: Mapping[str, Any], text: str, write: Callable[[], dict[str, str]], after: str = ""
) -> None:
    """Write the files that were asked for, and tell the outcome, also where a file cannot be written.

    Args:
        output: how it is told.
        data: the outcome as JSON can hold it, without its files.
        text: the same to be read.
        write: writes the files and returns their paths by what they are.
        after: text that is true only once the files are there.

    Raises:
        OSError: a file cannot be written; the numbers have been told.
    """
    try:
        files = write()
    except OSError as error:
        from typer import Exit

        from .failure import failure_of

        failure = failure_of(error)
        finish(output, {**data, "files": {}, **failure.to_dict()}, text)
        if output.json:
            raise Exit(failure.exit_code) from error
        raise
    finish(output, {**data, "files": files}, f"{text}\n\n{after}" if after else text)
    for name, path in files.items():
        log(output, f"{name.capitalize()}: {path}")


def reworded(value: Any, told: bool = False) -> Any:
    """The same data with its sentences in the words of the command line."""
    if isinstance(value, Mapping):
        return {key: reworded(item, key in _SENTENCES) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [reworded(item, told) for item in value]
    return in_options(value) if told and isinstance(value, str) else value


def log(output: "Output", text: str) -> None:
    """One line on stderr, unless JSON or quiet was asked for."""
    if not (output.json or output.quiet):
        tell(sys.stderr, in_options(text.replace("\n", "\\n")))


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

    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(visible(text), total=None)
        yield


@contextlib.contextmanager
def _late_line(text: str) -> Iterator[None]:
    import threading

    timer = threading.Timer(PATIENCE, lambda: tell(sys.stderr, f"{text} ..."))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def write_picture(output: "Writing", plot: Path | None, draw: Callable[[], Any]) -> dict[str, str]:
    """Draw and write a picture where one was asked for; its path by what it is."""
    if plot is None:
        return {}
    from ..show import save

    return {"picture": str(save(draw(), plot, overwrite=output.force))}


def check_targets(output: "Writing", *targets: tuple[str, Path | None, tuple[str, ...]]) -> None:
    """Refuse, before any work is done, files that could not be written at its end.

    Args:
        output: says whether files that exist may be replaced.
        *targets: for each file the name of its option, its path or None, and the suffixes that it may have.

    Raises:
        UsageError: a suffix that does not fit, a folder that does not exist, a file that does, or two in one place.
        OSError: a folder that cannot be written to.
    """
    from ..errors import UsageError

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
    """Refuse to make a path in a folder that cannot be written to.

    Raises:
        OSError: it cannot.
    """
    if not os.access(folder, os.W_OK):
        from ..show.files import refused

        raise refused(errno.EACCES, path)


def numbered(path: Path | None, count: int) -> list[Path]:
    """One path per run: the path itself, or with a number for each of several; none where no picture is wanted."""
    if path is None:
        return []
    return [path] if count == 1 else [path.with_stem(f"{path.stem}-{i + 1}") for i in range(count)]
