"""From an exception to what the user reads: one sentence, its kind, and the exit code."""

import dataclasses
import errno

from ..errors import DataError, UsageError
from .wording import in_options

# Two for wrong usage is the parser's own; 130 is what a shell shows for a process that Ctrl-C ended, 128 + SIGINT.
FAULT, USAGE, INVALID, REJECTED, INTERRUPTED = 1, 2, 3, 4, 130
# A file can have thousands of columns, and a sentence that names them all hides its beginning.
_LONGEST = 2000
NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclasses.dataclass(frozen=True)
class Failure:
    """Why a command ended early.

    Attributes:
        message: one sentence; empty where there is nothing to say.
        kind: "usage", "data", "fit", "output", "interrupted" or "internal".
        exit_code: code that the process ends with.
        hint: what to do next, on a second line.
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
    """A fit that has not converged, as its status says."""


class Interrupted(Exception):
    """Ctrl-C in a command that keeps what it has done, with a sentence about how to go on."""


def failure_of(error: BaseException) -> Failure:
    """The failure that an exception stands for."""
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort":
        return Failure("Interrupted; nothing more was written.", "interrupted", INTERRUPTED)
    if isinstance(error, Interrupted):
        return Failure(_sentence(error), "interrupted", INTERRUPTED)
    # Errors of the parser are known by what they can do: where typer keeps their classes changes with its versions.
    if hasattr(error, "format_message"):
        return _of_command_line(error)
    if isinstance(error, InvalidFit):
        return Failure(_sentence(error), "fit", INVALID)
    if isinstance(error, UsageError):
        return Failure(_sentence(error), "usage", USAGE)
    if isinstance(error, DataError):
        # A table below the sentence keeps its lines.
        sentence, newline, table = str(error).partition("\n")
        if "\n" in table:
            return Failure(_sentence(sentence), "data", REJECTED, table)
        return Failure(_sentence(sentence + newline + table), "data", REJECTED)
    if isinstance(error, FileExistsError):
        return Failure(f"'{error.filename}' exists already. Add --force, or give another name.", "output", USAGE)
    if isinstance(error, OSError) and error.filename is not None:
        return Failure(f"'{error.filename}' cannot be used: {error.strerror}.", "output", USAGE)
    if isinstance(error, OSError) and error.errno in NO_SPACE:
        words = f"Something cannot be written: {error.strerror}. Make room, or write elsewhere."
        return Failure(words, "output", USAGE)
    first = next(iter(str(error).strip().splitlines()), "no further words")
    return Failure(
        f"Unexpected {type(error).__name__}: {first}",
        "internal",
        FAULT,
        "This is a fault of the program or its installation. Add --debug to see where; 'fricjax doctor' checks both.",
    )


def _of_command_line(error: BaseException) -> Failure:
    """A wrong command, option or argument, as the parser words it; asking for help without a command says nothing."""
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "fricjax"
    message = " ".join(str(error.format_message()).split())  # type: ignore[attr-defined]
    if type(error).__name__ == "NoArgsIsHelpError":
        return Failure("", "usage", USAGE, str(error.format_message()))  # type: ignore[attr-defined]
    return Failure(message, "usage", getattr(error, "exit_code", USAGE), f"Try '{path} --help'.")


def _sentence(error: BaseException | str) -> str:
    """One line, in the words of the command line."""
    sentence = in_options(" ".join(str(error).split()))
    return sentence if len(sentence) <= _LONGEST else f"{sentence[: _LONGEST - 4]} ..."
