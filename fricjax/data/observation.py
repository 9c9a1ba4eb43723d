"""Maps from the motion of the mass to a reading.

Let x be the displacement of the mass from its equilibrium, and x^(k) its derivative of order k by time. The reading is

    y(t) = h(x^(k)(t)) + offset + drift t.

For a displacement, a velocity and an acceleration, h is the identity and k is 0, 1 and 2. A camera sees the
horizontal position of a pendulum: k = 0 and h(x) = L sin(x + angle). The offset is the zero of a displacement sensor,
the bias of a gyroscope or an accelerometer, or the position of the pivot in the picture. So the derivative of the
reading by a parameter p is ``h'(x^(k)) d x^(k)/dp``, and that by time is ``h'(x^(k)) x^(k+1) + drift``. Simulation, fit
and files use this one map.
"""

import dataclasses
from typing import Any

import numpy as np

from ..errors import DataError, UsageError, check_choice
from ..numbers import number

ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2, "projection": 0}
"""Kinds of observation, each with the order of its time derivative."""
MOTIONS = ("m", "rad")
_NAMES = {"m": "Displacement", "rad": "Angle"}
_RATES = {"m": ("Velocity", "Acceleration"), "rad": ("Angular velocity", "Angular acceleration")}
NAMES = (*_NAMES.values(), *(name for names in _RATES.values() for name in names), "Position")
"""Names of readings."""


@dataclasses.dataclass(frozen=True)
class Observation:
    """Map from the motion to the reading of an instrument.

    **Arguments:**

    - `kind`: "displacement", "velocity" (gyroscope, vibrometer), "acceleration", or "projection": the horizontal
      position of a pendulum in a film, ``L sin(x + angle)``.
    - `motion`: unit of the displacement of the mass, "m", or "rad" for a rotary rig or a pendulum. A projection has
      "rad".
    - `length`: for a projection, distance L from the pivot to the filmed point [m].
    - `angle`: for a projection, angle between the equilibrium and the vertical of the camera [rad].

    Raises `UsageError` for an unknown kind or motion, or a length that is not positive.

    Examples:
        A gyroscope on a pendulum, and a camera:

        >>> import fricjax as fj
        >>> gyroscope = fj.Observation("velocity", "rad")
        >>> gyroscope.unit, gyroscope.order
        ('rad/s', 1)
        >>> camera = fj.Observation("projection", length=0.42)
        >>> camera.unit, round(float(camera.read(0.5)), 4)
        ('m', 0.2014)
    """

    kind: str = "displacement"
    motion: str = "m"
    length: float = 1.0
    angle: float = 0.0

    def __post_init__(self) -> None:
        check_choice("kind of observation", self.kind, ORDERS)
        if self.kind == "projection":
            object.__setattr__(self, "motion", "rad")
        check_choice("motion", self.motion, MOTIONS)
        for name in ("length", "angle"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        if not self.length > 0:
            raise UsageError(f"length must be the positive length of the pendulum in m, got {self.length:g}.")

    @property
    def order(self) -> int:
        """Order of the time derivative that the instrument reads."""
        return ORDERS[self.kind]

    @property
    def linear(self) -> bool:
        """True if the reading is the displacement or a derivative of it."""
        return self.kind != "projection"

    @property
    def unit(self) -> str:
        """SI unit of the reading: "m", "rad/s", "m/s^2" ..."""
        return "m" if self.kind == "projection" else self.motion + ("", "/s", "/s^2")[self.order]

    @property
    def drift_unit(self) -> str:
        """SI unit of the reading per second."""
        return f"{self.motion}/s^{self.order + 1}" if self.order else f"{self.unit}/s"

    @property
    def name(self) -> str:
        """Name of the reading for a plot, such as "Angular velocity"."""
        if self.kind == "projection":
            return "Position"
        return _RATES[self.motion][self.order - 1] if self.order else _NAMES[self.motion]

    def read(self, value: Any, xp: Any = np) -> Any:
        """Return the reading, without offset and drift, of any shape.

        Args:
            value: derivative of order `order` of the displacement by time [m or rad over s^order].
            xp: `numpy` or `jax.numpy`.
        """
        return self.length * xp.sin(value + self.angle) if self.kind == "projection" else value

    def slope(self, value: Any, xp: Any = np) -> Any:
        """Return the derivative of the reading by `value`; arguments as in `read`."""
        return self.length * xp.cos(value + self.angle) if self.kind == "projection" else xp.ones_like(value)

    def gain(self, omega: float) -> float:
        """Return the reading per displacement of a small oscillation.

        Args:
            omega: its angular frequency [rad/s].
        """
        return float(self.slope(np.float64(0.0))) * omega**self.order

    @property
    def meta(self) -> dict[str, Any]:
        """Entries of the metadata of a record, which JSON can store."""
        fields = {} if self.kind != "projection" else {"length": self.length, "angle": self.angle}
        return {"quantity": self.unit, **({"projection": fields} if fields else {})}


DISPLACEMENT = Observation()


def observation_of(meta: dict[str, Any]) -> Observation:
    """Return the observation of a record from its metadata.

    Raises:
        DataError: a quantity that is not the unit of a displacement, velocity or acceleration.

    Examples:
        >>> from fricjax.data.observation import observation_of
        >>> observation_of({"quantity": "rad/s"}).kind
        'velocity'
    """
    unit = meta.get("quantity", "m")
    if isinstance(meta.get("projection"), dict):
        return Observation("projection", **meta["projection"])
    for kind in ("displacement", "velocity", "acceleration"):
        for motion in MOTIONS:
            if (known := Observation(kind, motion)).unit == unit:
                return known
    raise DataError(f"'quantity' must be the unit of a displacement, velocity or acceleration, but it is {unit!r}.")


def observed_as(name: Any, motion: str) -> Observation:
    """Return the observation that an argument names.

    Args:
        name: an `Observation`, or the name of its kind.
        motion: unit of the displacement: "m" or "rad".

    Raises:
        UsageError: neither; or a projection without its length.
    """
    if isinstance(name, Observation):
        return name
    if name == "projection":
        raise UsageError("A projection needs the length of the pendulum: give Observation('projection', length=0.42).")
    return Observation(name, motion)
