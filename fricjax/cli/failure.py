"""Failures of commands: a sentence, a kind and an exit code."""

import dataclasses
import errno

from ..errors import DataError, UsageError
from .wording import in_options

# The parser uses 2 for wrong usage. A shell reports 130 = 128 + SIGINT for a process that Ctrl-C ended.
DONE, INCOMPLETE, USAGE, INVALID, REJECTED, FAULT, INTERRUPTED = 0, 1, 2, 3, 4, 5, 130
CODES = {
    DONE: "The command has done its work.",
    INCOMPLETE: "`batch`: some runs are not ok. `doctor`: a check failed.",
    USAGE: "Wrong usage or configuration, or an output file that exists already.",
    INVALID: "`fit`, `compare`, `map`, `calibrate ringdown`: no optimum was found, or the fit does not describe "
    "its record. `check`: the run leaves a coefficient of `--free` undetermined.",
    REJECTED: "A file or record was rejected: missing, unreadable or unusable data.",
    FAULT: "A fault of the program, or a result that cannot be written.",
    INTERRUPTED: "Interrupted by Ctrl-C.",
}
"""Meaning of each exit code, in Markdown."""
# Longest sentence in characters. A list of thousands of columns would hide the beginning of the sentence.
_LONGEST = 2000
NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclasses.dataclass(frozen=True)
class Failure:
    """Reason why a command ended early.

    Attributes:
        message: one sentence, or empty.
        kind: "usage", "data", "fit", "output", "interrupted" or "internal".
        exit_code: exit code of the process.
        hint: advice on the next step, on a second line.
    """

    message: str
    kind: str
    exit_code: int
    hint: str = ""

    @property
    def text(self) -> str:
        """The lines for a terminal."""
        lines = [f"Error: {self.message}", self.hint] if self.message else [self.hint]
        return "\n".join(line for line in lines if line)

    def to_dict(self) -> dict[str, object]:
        """The failure as JSON can hold it."""
        table = {"details": self.hint} if self.kind == "data" and self.hint else {}
        return {"error": self.message, "kind": self.kind, "exit_code": self.exit_code, **table}


class InvalidFit(Exception):
    """A fit that does not describe its record."""


class Interrupted(Exception):
    """Ctrl-C in a command that keeps its results so far.

    The message says how to continue.
    """


def failure_of(error: BaseException) -> Failure:
    """Return the failure for an exception."""
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort":
        return Failure("Interrupted; nothing more was written.", "interrupted", INTERRUPTED)
    if isinstance(error, Interrupted):
        return Failure(_sentence(error), "interrupted", INTERRUPTED)
    # Errors of the parser are recognised by a method: the module of their classes changes with the version of typer.
    if hasattr(error, "format_message"):
        return _of_command_line(error)
    if isinstance(error, InvalidFit):
        return Failure(_sentence(error), "fit", INVALID)
    if isinstance(error, UsageError):
        return Failure(_sentence(error), "usage", USAGE)
    if isinstance(error, DataError):
        # Keep the lines of a table below the sentence.
        sentence, newline, table = str(error).partition("\n")
        if "\n" in table:
            return Failure(_sentence(sentence), "data", REJECTED, table)
        return Failure(_sentence(sentence + newline + table), "data", REJECTED)
    if isinstance(error, FileExistsError):
        return Failure(f"'{error.filename}' exists already. Add --force, or give another name.", "output", USAGE)
    if isinstance(error, OSError) and error.filename is not None:
        return Failure(f"'{error.filename}' cannot be used: {error.strerror}.", "output", FAULT)
    if isinstance(error, OSError) and error.errno in NO_SPACE:
        words = f"Something cannot be written: {error.strerror}. Make room, or write elsewhere."
        return Failure(words, "output", FAULT)
    first = next(iter(str(error).strip().splitlines()), "no further words")
    return Failure(
        f"Unexpected {type(error).__name__}: {first}",
        "internal",
        FAULT,
        "This is a fault of the program or its installation. Add --debug to see where; 'fricjax doctor' checks both.",
    )


def _of_command_line(error: BaseException) -> Failure:
    """Return the failure for a wrong command, option or argument.

    A call without a command shows the help page and has no message.
    """
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "fricjax"
    message = " ".join(str(error.format_message()).split())  # type: ignore[attr-defined]
    if type(error).__name__ == "NoArgsIsHelpError":
        return Failure("", "usage", USAGE, str(error.format_message()))  # type: ignore[attr-defined]
    return Failure(message, "usage", getattr(error, "exit_code", USAGE), f"Try '{path} --help'.")


def _sentence(error: BaseException | str) -> str:
    """Return one line that names options instead of Python arguments."""
    sentence = in_options(" ".join(str(error).split()))
    return sentence if len(sentence) <= _LONGEST else f"{sentence[: _LONGEST - 4]} ..."
