"""The rig's file: TOML with the names of `Rig`, values in SI units or with a unit of their own.

mass = { value = 410.7, std = 0.3, unit = "g" }
frequency = "12.600(2) Hz"
normal_force = { value = 9.66, std = "0.5 %" }
restoring = "linear"
"""

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..data.files import content
from ..errors import UsageError, brief, nearest
from ..show.files import write_text
from .inputs import ARGUMENTS, RESTORING
from .measured import Measured

if TYPE_CHECKING:
    from .rig import Rig

_LARGEST, _WIDEST = 100_000, 1_000
"""Bytes of the largest file that can be a rig's, and characters of its longest line; one has a few hundred in all.

The time that a dotted key takes grows with the square of its length.
"""
_HEAD = (
    "# A rig, in SI units: kg, N/m, N s/m, N; for rotary rigs kg m^2, N m/rad, N m s/rad, N m.",
    '# std is the standard uncertainty (k = 1); a unit may be added, as in { value = 410.7, std = 0.3, unit = "g" }.',
)


def read_rig(path: Path) -> "Rig":
    """The rig that a file describes; every refusal names the file, the key and the value."""
    from .rig import Rig

    table = read_table(path)
    try:
        return Rig(**table)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def read_table(path: Path) -> dict[str, Any]:
    """The arguments of `Rig` that a file holds, as they stand there.

    Raises:
        UsageError: no file, no TOML, an unknown key, or one that is missing.
    """
    table = _parsed(path)
    for key in table:
        if key not in ARGUMENTS:
            known = ", ".join(ARGUMENTS)
            raise UsageError(
                f"{path}: there is no key {brief(key)} in a rig file; known are {known}.{nearest(key, ARGUMENTS)}"
            )
    for key in ("mass", "normal_force"):
        if key not in table:
            raise UsageError(f"{path}: '{key}' is missing; add a line such as {key} = 1.0.")
    return table


def _parsed(path: Path) -> dict[str, Any]:
    try:
        # Editors on Windows begin a file with a mark of its encoding, which is no TOML.
        text = content(path, _LARGEST, UsageError).decode("utf-8-sig")
        if any(len(line) > _WIDEST for line in text.splitlines()):
            raise UsageError(f"{path}: this is no rig file: a line has more than {_WIDEST} characters.")
        return tomllib.loads(text)
    except FileNotFoundError as error:
        siblings = [entry.name for entry in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise UsageError(
            f"There is no rig file '{path}'.{nearest(path.name, siblings)} Give the path of a TOML file with mass, "
            "stiffness, ..."
        ) from error
    except OSError as error:
        raise UsageError(f"The rig file '{path}' cannot be read: {error.strerror}.") from error
    except RecursionError as error:
        raise UsageError(f"{path}: this is no rig file: its tables are nested too deeply.") from error
    except UsageError:
        raise
    except ValueError as error:  # TOML that is none, other encodings, and numbers of thousands of digits
        raise UsageError(f"{path}: this is no valid TOML file: {str(error)[:200]}.") from error


def write_rig(rig: "Rig", path: Path, *, overwrite: bool = False) -> Path:
    """Write a rig as TOML, whole or not at all."""
    lines = [*_HEAD, *(f"{name} = {_entry(value)}" for name, value in rig.numbers().items()), _restoring_line(rig)]
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)


def _entry(number: Measured) -> str:
    return f"{{ value = {number.value!r}, std = {number.std!r} }}" if number.std > 0 else repr(number.value)


def _restoring_line(rig: "Rig") -> str:
    form = type(rig.restoring).__name__
    name = form.lower()
    if name not in RESTORING:
        raise UsageError(f"A rig file cannot hold the restoring force {form}; build that rig in Python.")
    return f'restoring = "{name}"'
