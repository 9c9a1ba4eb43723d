"""What a command does before its first array: double precision, and warnings in one line."""

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .output import tell
from .wording import in_options

if TYPE_CHECKING:
    from .options import Output


def prepare(output: "Output") -> None:
    """Double precision on, and every warning a line."""
    _word_warnings(output)
    import jax

    jax.config.update("jax_enable_x64", True)


def _word_warnings(output: "Output") -> None:
    """Warnings of this package become one line each on stderr; those of its dependencies concern no user."""

    def show(message: Warning | str, category: Any, filename: str, *_: Any, **__: Any) -> None:
        if not output.quiet and "fricjax" in Path(filename).parts:
            tell(sys.stderr, in_options(f"Warning: {' '.join(str(message).split())}"))

    warnings.showwarning = show
