"""Output of commands: results on stdout, log and warnings on stderr."""

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

# Commands that take longer than this log their time [s].
PATIENCE = 2.0
# Control characters except tab and newline, marks that change the direction of writing, surrogates.
_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")
# Keys of an outcome that hold sentences.
_SENTENCES = ("status", "warnings", "error", "notes", "remarks")


def _for_json(value: Any) -> Any:
    """Convert a value for JSON, with null for NaN and infinity."""
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
    """Return a mapping as strict JSON, with control characters escaped."""
    text = json.dumps(_for_json(value), indent=2, ensure_ascii=ascii_only, allow_nan=False)
    return _UNSEEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def tell(stream: TextIO, text: str) -> None:
    """Write lines of text to a stream.

    All text leaves the program through this function. Names and cells of files may contain control characters, or
    characters that the encoding of the stream cannot represent. Both are written as escapes.
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
    """Write one JSON object to a stream of any encoding."""
    try:
        stream.write(json_text(value) + "\n")
    except UnicodeEncodeError:
        stream.write(json_text(value, ascii_only=True) + "\n")


def visible(text: str) -> str:
    """Return the text with control characters and invisible characters as escapes."""
    return _UNSEEN.sub(lambda match: match[0].encode("unicode_escape", "surrogatepass").decode("ascii"), text)


def finish(output: "Output", data: Mapping[str, Any], text: str) -> None:
    """Print the outcome on stdout: `data` as JSON with ``--json``, else `text`."""
    try:
        if output.json:
            tell_json(sys.stdout, _reworded(data))
        else:
            tell(sys.stdout, in_options(text))
        sys.stdout.flush()
    # `run` handles a reader that has closed the pipe.
    except BrokenPipeError:
        raise
    except OSError as error:
        # Python would try to write the rest again when the process ends.
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
    """Write the files and show the outcome, even after a failed write.

    Args:
        output: options for the output.
        data: outcome as plain data, without its files.
        text: outcome as text.
        write: writes the files and returns their paths by kind.
        after: text to add once the files exist.
        failed: status of a fit that does not describe its record.

    Raises:
        OSError: a file cannot be written. The outcome has been shown.
        InvalidFit: the fit does not describe its record. The outcome has been shown.
        Exit: either of the two with ``--json``. The object on stdout contains the error.
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
        raise InvalidFit(f"The fit is not valid: {failed} Its results are marked so.")


def _reworded(value: Any, sentence: bool = False) -> Any:
    """Return the data with options instead of Python arguments in its sentences."""
    if isinstance(value, Mapping):
        return {key: _reworded(item, key in _SENTENCES) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_reworded(item, sentence) for item in value]
    return in_options(value) if sentence and isinstance(value, str) else value


def prepare(output: "Output") -> None:
    """Switch on double precision and the display of warnings.

    Each warning of this package becomes a line on stderr. Call this function before the first array is made.
    """

    def show(message: Warning | str, category: Any, filename: str, *_: Any, **__: Any) -> None:
        # Warnings of other packages do not concern the user.
        if not output.quiet and "fricjax" in Path(filename).parts:
            tell(sys.stderr, in_options(f"Warning: {' '.join(str(message).split())}"))

    warnings.showwarning = show
    import jax

    jax.config.update("jax_enable_x64", True)


def log(output: "Output", text: str) -> None:
    """Write one line to stderr, unless the output is JSON or quiet."""
    if not (output.json or output.quiet):
        tell(sys.stderr, in_options(text.replace("\n", "\\n")))


@contextlib.contextmanager
def working(output: "Output", text: str) -> Iterator[None]:
    """Show the progress of the work.

    The time is logged at the end if it is more than two seconds.
    If stderr is not a terminal, a line is written from time to time, so that the log of a job shows its progress.
    """
    silent, started = output.json or output.quiet, time.perf_counter()
    with progress(not silent and from_environment() is not False), show_working(text):
        yield
    elapsed = time.perf_counter() - started
    if elapsed > PATIENCE:
        log(output, f"{text}: done in {elapsed:.1f} s")
