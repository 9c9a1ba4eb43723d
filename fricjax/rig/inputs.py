"""Arguments of a rig: their checks, and their TOML file.

The checks need no JAX, so they run before a machine is built. The keys of the file are the arguments of `Rig`. Each
number is in SI units or has a unit:

    mass = { value = 410.7, std = 0.3, unit = "g" }
    frequency = "12.600(2) Hz"
    normal_force = { value = 9.66, std = "0.5 %" }
    restoring = "linear"
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..data.files import read_toml
from ..errors import UsageError, brief, nearest
from ..show.files import write_text
from .measured import Measured, is_traced
from .quantity import UNITS, quantity

RESTORING = ("linear", "cubic", "pendulum")
ARGUMENTS = (*UNITS, "restoring")
# Limits of plausible values [SI units], for which squares and products do not overflow.
_HUGE, _TINY = 1e60, 1e-60
_POSITIVE = ("mass", "stiffness", "frequency", "nonlinearity_period")
# Half the wavelength of a helium-neon laser, 633 nm: one fringe of a single-pass interferometer [m].
_FRINGE = 316.5e-9
# Inputs of the instrument: required value, and the remedy for any other value. Known corrections are applied to the
# record before the fit.
READING = {
    "displacement_scale": (1.0, "multiply the displacements of the record by it, and give its standard uncertainty"),
    "time_scale": (1.0, "multiply the times of the record by it, and give its standard uncertainty"),
    "periodic_nonlinearity": (0.0, "give its standard uncertainty alone, for an amplitude A of any phase A/sqrt(2)"),
}
_HEAD = (
    "# A rig, in SI units: kg, N/m, N s/m, N; for rotary rigs kg m^2, N m/rad, N m s/rad, N m.",
    '# std is the standard uncertainty (k = 1); a unit may be added, as in { value = 410.7, std = 0.3, unit = "g" }.',
)
_ALTERNATIVES = {
    "stiffness": "frequency",
    "frequency": "stiffness",
    "damping": "damping_ratio",
    "damping_ratio": "damping",
}


def checked(arguments: Mapping[str, Any], restoring: str = "linear") -> dict[str, Measured | None]:
    """Convert the numbers of a rig to SI units and check them.

    Args:
        arguments: the numbers in any form that `Rig` accepts; a missing number or None is unknown.
        restoring: name of the restoring force: one of `RESTORING`, or that of a user-defined class.

    Returns:
        The numbers by name; None for unknown ones.

    Raises:
        UsageError: a value is impossible, a unit does not fit, or two values describe the same quantity.
    """
    numbers = {name: arguments.get(name) for name in UNITS}
    numbers["drag"] = arguments.get("drag", 0.0)
    periodic = numbers["periodic_nonlinearity"] is not None
    # An encoder has no fringe, so a rotary rig must give the period.
    if periodic and numbers["nonlinearity_period"] is None and restoring != "pendulum":
        numbers["nonlinearity_period"] = _FRINGE
    values = {name: None if number is None else quantity(name, number) for name, number in numbers.items()}
    _check_values({name: each for name, each in values.items() if each is not None and not is_traced(each.value)})

    if (values["stiffness"] is None) == (values["frequency"] is None):
        got = "neither" if values["stiffness"] is None else "both"
        raise UsageError(f"A rig needs its stiffness [N/m] or its natural frequency [Hz]: give one of them, got {got}.")
    if values["damping"] is not None and values["damping_ratio"] is not None:
        raise UsageError("A rig has a damping [N s/m] or a damping_ratio [1]: give one of them, got both.")
    if values["nonlinearity_period"] is not None and not periodic:
        raise UsageError("nonlinearity_period belongs to a periodic_nonlinearity: give both, or leave it out.")
    if periodic and values["nonlinearity_period"] is None:
        raise UsageError("The periodic_nonlinearity of a rotary rig needs its period: give nonlinearity_period [rad].")
    if restoring == "cubic" and values["k3"] is None:
        raise UsageError("A cubic spring needs its coefficient: give k3 [N/m^3].")
    if restoring != "cubic" and values["k3"] is not None:
        raise UsageError("k3 belongs to a cubic spring: give restoring='cubic' with it, or leave it out.")
    return values


def _check_values(known: Mapping[str, Measured]) -> None:
    """Refuse impossible values; `known` contains no traced ones."""
    for name, number in known.items():
        if max(abs(number.value), number.std) > _HUGE:
            raise UsageError(
                f"{name} is no number of a rig: {number.value:g} with a standard uncertainty {number.std:g}."
            )
        if name in _POSITIVE and not number.value > _TINY:
            raise UsageError(f"{name} must be a positive number of {UNITS[name]}, got {number.value:g}.")
        if name == "normal_force" and not number.value >= 0:
            raise UsageError(f"normal_force must not be negative, got {number.value:g} N.")
        if name in READING and number.value != READING[name][0]:
            value, remedy = READING[name]
            raise UsageError(f"{name} must be {value:g}, got {number.value:.10g}: {remedy}.")


def check_restoring(name: Any) -> None:
    """Refuse an unknown restoring force.

    Raises:
        UsageError: the name is unknown; the message lists the known names.
    """
    known = ", ".join(RESTORING)
    if not isinstance(name, str):
        raise UsageError(f"restoring must be a restoring force or its name ({known}), got {brief(name)}.")
    if name not in RESTORING:
        raise UsageError(f"There is no restoring force {brief(name)}; known are {known}.{nearest(name, RESTORING)}")


def replaced(values: Mapping[str, Any]) -> dict[str, Any]:
    """Add None for each argument that a new one replaces.

    For example, a new stiffness replaces the frequency.

    Raises:
        UsageError: a name is not an argument of `Rig`.
    """
    for name in values:
        if name not in ARGUMENTS:
            raise UsageError(f"A rig has no '{name}'; known are {', '.join(ARGUMENTS)}.{nearest(name, ARGUMENTS)}")
    displaced = {_ALTERNATIVES[name]: None for name in values if name in _ALTERNATIVES}
    if values.get("restoring", "cubic") != "cubic":
        displaced["k3"] = None
    if values.get("periodic_nonlinearity", 0.0) is None:
        displaced["nonlinearity_period"] = None
    return {**displaced, **values}


def read_table(path: Path) -> dict[str, Any]:
    """Read the arguments of `Rig` from a TOML file, without conversion.

    Raises:
        UsageError: the file is missing or is not TOML, or a key is unknown or missing; the message names file and key.
    """
    return read_toml(path, "rig", ARGUMENTS, {"mass": "1.0", "normal_force": "1.0"})


def write_table(numbers: Mapping[str, Measured], restoring: str, path: Path, *, overwrite: bool = False) -> Path:
    """Write the numbers and the restoring force as TOML, atomically.

    Raises:
        UsageError: the restoring force has no name in a file.
    """
    name = restoring.lower()
    if name not in RESTORING:
        raise UsageError(f"A rig file cannot hold the restoring force {restoring}; build that rig in Python.")
    entry = lambda number: f"{{ value = {number.value!r}, std = {number.std!r} }}" if number.std > 0 else number.value
    lines = [*_HEAD, *(f"{key} = {entry(number)}" for key, number in numbers.items()), f'restoring = "{name}"']
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)
