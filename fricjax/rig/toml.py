"""The rig's file: TOML with the names of `Rig`, each number in SI units or with a unit beside it.

mass = { value = 410.7, std = 0.3, unit = "g" }
frequency = "12.600(2) Hz"
normal_force = { value = 9.66, std = "0.5 %" }
restoring = "linear"
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..data.files import content
from ..errors import UsageError, brief, nearest
from ..show.files import write_text
from .inputs import ARGUMENTS, RESTORING
from .measured import Measured

# Bytes of the largest file that can be a rig's, and characters of its longest line; one has a few hundred in all. The
# time that a dotted key takes grows with the square of its length.
_LARGEST, _WIDEST = 100_000, 1_000
_HEAD = (
    "# A rig, in SI units: kg, N/m, N s/m, N; for rotary rigs kg m^2, N m/rad, N m s/rad, N m.",
    '# std is the standard uncertainty (k = 1); a unit may be added, as in { value = 410.7, std = 0.3, unit = "g" }.',
)


def read_table(path: Path) -> dict[str, Any]:
    """The arguments of `Rig` that a file holds, as they stand there.

    Raises:
        UsageError: no file, no TOML, an unknown key, or one that is missing; the sentence names file and key.
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


def write_table(numbers: Mapping[str, Measured], restoring: str, path: Path, *, overwrite: bool = False) -> Path:
    """Write the numbers and the restoring force of a rig as TOML; the file appears complete or not at all.

    Raises:
        UsageError: a restoring force that a file cannot name.
    """
    name = restoring.lower()
    if name not in RESTORING:
        raise UsageError(f"A rig file cannot hold the restoring force {restoring}; build that rig in Python.")
    entry = lambda number: f"{{ value = {number.value!r}, std = {number.std!r} }}" if number.std > 0 else number.value
    lines = [*_HEAD, *(f"{key} = {entry(number)}" for key, number in numbers.items()), f'restoring = "{name}"']
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)
