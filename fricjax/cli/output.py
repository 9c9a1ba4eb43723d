"""What a command says: results as text or JSON on stdout, log and warnings on stderr."""

import contextlib
import json
import math
import os
import re
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from typer import Exit

from ..show.working import erase, from_environment, progress
from ..show.working import working as show_working
from .failure import INVALID, InvalidFit, failure_of
from .wording import in_options

if TYPE_CHECKING:
    from .options import Output, Writing

# Seconds from which on it is told how long a command took.
PATIENCE = 2.0
# Control characters but tab and newline, marks that turn the direction of writing, halves of characters.
_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")
# Keys of an outcome under which sentences stand.
_SENTENCES = ("status", "warnings", "error", "notes", "remarks")


def _for_json(value: Any) -> Any:
    """A value as JSON can hold it: arrays become lists, what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): _for_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_for_json(item) for item in value]
    if hasattr(value, "tolist"):
        return _for_json(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def json_text(value: Mapping[str, Any], *, ascii_only: bool = False) -> str:
    """A mapping as JSON that every parser accepts and no terminal obeys."""
    text = json.dumps(_for_json(value), indent=2, ensure_ascii=ascii_only, allow_nan=False)
    return _UNSEEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def tell(stream: TextIO, text: str) -> None:
    """Write lines of text to a stream, the one way by which text leaves the program.

    Names and cells of files may hold what a terminal would obey, and what its encoding does not know: both are written
    as escapes.
    """
    text = visible(text) + "\n"
    if stream is sys.stderr:
        erase()
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
            tell_json(sys.stdout, _reworded(data))
        else:
            tell(sys.stdout, in_options(text))
        sys.stdout.flush()
    # A reader that goes away is no failure, and `run` treats it so.
    except BrokenPipeError:
        raise
    except OSError as error:
        # What could not be written would be tried again when the process ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(error.errno, error.strerror, "stdout") from error


def deliver(
    output: "Writing",
    data: Mapping[str, Any],
    text: str,
    write: Callable[[], dict[str, str]],
    *,
    after: str = "",
    failed: str = "",
) -> None:
    """Write the files that were asked for, and show the outcome, also where a file cannot be written.

    Args:
        output: how it is shown.
        data: the outcome as JSON can hold it, without its files.
        text: the same to be read.
        write: writes the files and returns their paths by what they are.
        after: text that is true only once the files are there.
        failed: status of a fit that has not converged.

    Raises:
        OSError: a file cannot be written; the numbers have been shown.
        InvalidFit: the fit has not converged; the same.
        Exit: either, with JSON, for the one object on stdout says so already.
    """
    if failed:
        data = {**data, "error": failed, "kind": "fit", "exit_code": INVALID}
    try:
        files = write()
    except OSError as error:
        failure = failure_of(error)
        finish(output, {**data, "files": {}, **failure.to_dict()}, text)
        if output.json:
            raise Exit(failure.exit_code) from error
        raise
    finish(output, {**data, "files": files}, f"{text}\n\n{after}" if after else text)
    for name, path in files.items():
        log(output, f"{name.capitalize()}: {path}")
    if failed and output.json:
        raise Exit(INVALID)
    if failed:
        raise InvalidFit(f"The fit has not converged, {failed} Its results are marked so.")


def _reworded(value: Any, sentence: bool = False) -> Any:
    """The same data with its sentences in the words of the command line."""
    if isinstance(value, Mapping):
        return {key: _reworded(item, key in _SENTENCES) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_reworded(item, sentence) for item in value]
    return in_options(value) if sentence and isinstance(value, str) else value


def prepare(output: "Output") -> None:
    """What comes before the first array: double precision on, and every warning of this package a line on stderr."""

    def show(message: Warning | str, category: Any, filename: str, *_: Any, **__: Any) -> None:
        # Warnings of the packages that this one is built on concern no user.
        if not output.quiet and "fricjax" in Path(filename).parts:
            tell(sys.stderr, in_options(f"Warning: {' '.join(str(message).split())}"))

    warnings.showwarning = show
    import jax

    jax.config.update("jax_enable_x64", True)


def log(output: "Output", text: str) -> None:
    """One line on stderr, unless JSON or quiet was asked for."""
    if not (output.json or output.quiet):
        tell(sys.stderr, in_options(text.replace("\n", "\\n")))


@contextlib.contextmanager
def working(output: "Output", text: str) -> Iterator[None]:
    """Show how the work goes on, and how long it took where that was longer than two seconds.

    Where stderr is no terminal there is a line now and then, for a job says in its log where it is.
    """
    silent, started = output.json or output.quiet, time.perf_counter()
    with progress(not silent and from_environment() is not False), show_working(text):
        yield
    elapsed = time.perf_counter() - started
    if elapsed > PATIENCE:
        log(output, f"{text}: done in {elapsed:.1f} s")
