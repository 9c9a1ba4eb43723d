"""The rig's file: TOML with the names of `Rig`, values in SI units or with a unit of their own.

mass = { value = 410.7, std = 0.3, unit = "g" }
frequency = "12.600(2) Hz"
normal_force = { value = 9.66, std = "0.5 %" }
restoring = "linear"
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..data.errors import UsageError, nearest
from ..oscillator.restoring import Cubic, Linear, Pendulum
from ..show.files import write_text
from .measured import Measured
from .quantity import UNITS

if TYPE_CHECKING:
    from .rig import Rig

_KEYS = (*UNITS, "restoring")
_NAMES = {Linear: "linear", Cubic: "cubic", Pendulum: "pendulum"}
_HEAD = (
    "# A rig, in SI units: kg, N/m, N s/m, N; for rotary rigs kg m^2, N m/rad, N m s/rad, N m.",
    '# std is the standard uncertainty (k = 1); a unit may be added, as in { value = 410.7, std = 0.3, unit = "g" }.',
)


def read_rig(path: Path) -> "Rig":
    """The rig that a file describes; every refusal names the file, the key and the value."""
    from .rig import Rig

    table = _table(path)
    for key in table:
        if key not in _KEYS:
            raise UsageError(
                f"{path}: there is no key '{key}' in a rig file; known are {', '.join(_KEYS)}.{nearest(key, _KEYS)}"
            )
    for key in ("mass", "normal_force"):
        if key not in table:
            raise UsageError(f"{path}: '{key}' is missing; add a line such as {key} = 1.0.")
    try:
        return Rig(**table)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def _table(path: Path) -> Mapping[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise UsageError(
            f"There is no rig file '{path}'; give the path of a TOML file with mass, stiffness, ..."
        ) from error
    except OSError as error:
        raise UsageError(f"The rig file '{path}' cannot be read: {error.strerror}.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: this is no valid TOML file: {error}.") from error


def write_rig(rig: "Rig", path: Path, *, overwrite: bool = False) -> Path:
    """Write a rig as TOML, whole or not at all."""
    lines = [*_HEAD, *(f"{name} = {_entry(value)}" for name, value in rig.numbers().items()), _restoring_line(rig)]
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)


def _entry(number: Measured) -> str:
    return f"{{ value = {number.value!r}, std = {number.std!r} }}" if number.std > 0 else repr(number.value)


def _restoring_line(rig: "Rig") -> str:
    name = _NAMES.get(type(rig.restoring))
    if name is None:
        raise UsageError(
            f"A rig file cannot hold the restoring force {type(rig.restoring).__name__}; build that rig in Python."
        )
    return f'restoring = "{name}"'
