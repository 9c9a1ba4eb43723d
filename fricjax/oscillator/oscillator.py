"""Equation of motion of a mass on a spring with friction.

``m a + damping v + drag v|v| + R(x) + F = 0``, with the restoring force ``R`` from
:mod:`fricjax.oscillator.restoring` and the friction force ``F`` from :mod:`fricjax.friction`. A rotary rig uses the
same equation with the moment of inertia as mass and angles as displacements. Each coefficient has the shortest
unambiguous name. A `Drive` adds floor motion and a decaying holding force.
"""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..friction.base import AbstractFriction, Scalar, State, Values, law_name, laws_of, scalar
from ..friction.catalogue import short_names
from ..friction.coefficient import Coefficient, check_coefficients, not_negative, positive
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, plain, scaled, styled
from ..show.thumbnail import Curve, curves_svg
from .restoring import AbstractRestoring, Linear

# Range of the plotted friction force: dead bands of a typical release, and multiples of the law's velocity scale.
_RELEASE, _BEYOND = 20, 5


class Oscillator(eqx.Module, Reported):
    """Mass on a spring with viscous damping, quadratic drag and friction.

    Attributes:
        mass: moving mass [kg].
        stiffness: slope of the restoring force at the equilibrium [N/m].
        damping: viscous coefficient c [N s/m]; a negative value indicates a friction force that falls with speed.
        normal_force: load on the contact [N].
        friction: friction law.
        restoring: form of the restoring force.
        drag: quadratic drag coefficient [N s^2/m^2].

    Raises:
        ValueError: a mass or stiffness that is not positive, a negative normal force, or an invalid friction law.

    Examples:
        >>> from fricjax.friction import Coulomb
        >>> oscillator = Oscillator(0.1, 1000.0, damping=0.05, normal_force=10.0, friction=Coulomb(mu=0.01))
        >>> print(f"{float(oscillator.angular_frequency):.1f} rad/s, dead band {float(oscillator.dead_band):.1e} m")
        100.0 rad/s, dead band 1.0e-04 m
        >>> oscillator.report().facts[0]
        ('natural frequency', '15.9155 Hz')
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mass": positive("kg", "moving mass"),
        "stiffness": positive("N/m", "slope of the restoring force at the equilibrium"),
        "damping": Coefficient("N s/m", "viscous coefficient"),
        "normal_force": not_negative("N", "load on the contact")._replace(fitted_as="logarithm"),
        "drag": Coefficient("N s^2/m^2", "quadratic drag"),
    }

    mass: Scalar = eqx.field(converter=scalar)
    stiffness: Scalar = eqx.field(converter=scalar)
    damping: Scalar = eqx.field(converter=scalar)
    normal_force: Scalar = eqx.field(converter=scalar)
    friction: AbstractFriction
    restoring: AbstractRestoring = eqx.field(default_factory=Linear, kw_only=True)
    drag: Scalar = eqx.field(converter=scalar, default=0.0, kw_only=True)

    def __check_init__(self) -> None:
        if not isinstance(self.friction, AbstractFriction):
            raise ValueError(
                f"friction must be a friction law such as fricjax.friction.Coulomb(mu=0.1), got {self.friction!r}."
            )
        check_coefficients(self, self.coefficients)

    def __repr__(self) -> str:
        return eqx.tree_pformat(self, short_arrays=False)

    def report(self) -> Report:
        """List all coefficients with units, and derived quantities."""
        parts = (self, self.restoring, *laws_of(self.friction))
        coefficients = [
            (type(part).__name__.lower(), name, getattr(part, name), coefficient.unit)
            for part in parts
            for name, coefficient in part.coefficients.items()
            if getattr(part, name) is not None
        ]
        rows = [[of, name, Cell(_shown(value), value=value), unit] for of, name, value, unit in coefficients]
        facts = []
        # Derived quantities require a single oscillator with known values.
        if all(map(_single, jax.tree.leaves(self))):
            facts = [
                ("natural frequency", f"{_shown(self.angular_frequency / (2 * jnp.pi))} Hz"),
                ("damping ratio", _shown(self.damping_ratio)),
                ("dead band", f"{_shown(self.dead_band)} m"),
            ]
        data = {f"{of}.{name}": value for of, name, value, _ in coefficients}
        return Report([Table(["Of", "Coefficient", "Value", "Unit"], rows)], facts, heading="Oscillator", data=data)

    def thumbnails(self) -> Sequence[str]:
        if not all(map(_single, jax.tree.leaves(self))):
            return []
        return [curves_svg([Curve(*self._characteristic())], ("Velocity", "m/s"), ("Friction force", "N"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the steady friction force against velocity with matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        (v, unit_v), (force, unit_f) = map(scaled, self._characteristic(), ("m/s", "N"))
        axes[0, 0].plot(v, force)
        axes[0, 0].set_xlabel(axis_label("Velocity", unit_v))
        axes[0, 0].set_ylabel(axis_label("Friction force", unit_f))
        axes[0, 0].set_title(law_name(self.friction), loc="left")
        return styled(drawing, style)

    def _characteristic(self) -> tuple[np.ndarray, np.ndarray]:
        """Return velocities [m/s] and steady friction forces [N].

        At zero velocity the force jumps between the static friction forces of both directions.
        """
        reached = float(self.angular_frequency * self.dead_band)
        speeds = [_RELEASE * reached, _BEYOND * float(self.friction.velocity_scale())]
        fastest = max((speed for speed in speeds if np.isfinite(speed)), default=0.0) or 1.0
        speed, load = np.linspace(0.0, fastest, 200), self.normal_force
        force = np.broadcast_to(np.asarray(self.friction.sliding_force(jnp.asarray(speed), load)), speed.shape)
        v, forces = np.append(0.0, speed), np.append(float(self.friction.static_force(load)), force)
        return np.append(-v[::-1], v), np.append(-forces[::-1], forces)

    @property
    def angular_frequency(self) -> Scalar:
        """Undamped natural angular frequency sqrt(k/m) [rad/s]."""
        return jnp.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> Scalar:
        """Viscous damping ratio c/(2 sqrt(k m)) [1]."""
        return self.damping / (2 * jnp.sqrt(self.stiffness * self.mass))

    @property
    def dead_band(self) -> Scalar:
        """Half-width x_d = mu N/k of the dead band [m].

        Within it dynamic friction balances the spring.
        """
        return self.friction.dynamic_force(self.normal_force) / self.stiffness

    def restoring_force(self, x: Values) -> Values:
        """Return the restoring force R(x) [N]."""
        return self.restoring.force(x, self.stiffness)

    def hysteresis(self, x: Values) -> Values:
        """Return the internal friction of the spring [N], opposing the motion."""
        return self.restoring.hysteresis(x, self.stiffness)

    def dissipation(self, v: Values) -> Values:
        """Return the force of damping and drag [N].

        Positive if it opposes a positive velocity.
        """
        return (self.damping + self.drag * jnp.abs(v)) * v

    def friction_force(self, v: Values, state: State) -> Values:
        """Return the sliding friction force [N].

        Positive if it opposes a positive velocity.
        """
        return self.friction.force(v, state, self.normal_force)

    def rates(self, x: Scalar, v: Scalar, state: State) -> tuple[Scalar, State]:
        """Return the acceleration [m/s^2] and the rates of internal friction states."""
        rate = self.friction.rate(v, state, self.normal_force)
        friction = self.friction.force_of(v, state, rate, self.normal_force)
        return -(self.dissipation(v) + self.restoring_force(x) + friction) / self.mass, rate


def _single(value: Any) -> bool:
    """Return True for a single, untraced number."""
    return not isinstance(value, tuple | Tracer) and not jnp.shape(value)


def _shown(value: Any) -> str:
    """Format a coefficient for display; arrays only by their shape."""
    if isinstance(value, tuple):
        return ", ".join(map(_shown, value))
    return plain(float(value)) if _single(value) else f"array{list(jnp.shape(value))}"


class Leaf(NamedTuple):
    """Coefficient of an oscillator with its names and leaf index.

    Attributes:
        name: shortest unambiguous name.
        dotted: full path.
        index: position among the leaves.
        coefficient: unit, range and description.
    """

    name: str
    dotted: str
    index: int
    coefficient: Coefficient

    @property
    def kind(self) -> str:
        """Last part of the name."""
        return self.name.rsplit(".", 1)[-1]

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.coefficient.unit


def leaves_of(oscillator: Oscillator) -> tuple[Leaf, ...]:
    """Return all coefficients of an oscillator in the order of its leaves."""
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(oscillator)[0]]
    dotted = [".".join(_parts(path)) for path in paths]
    pairs = zip(short_names(dotted), paths, strict=True)
    return tuple(Leaf(*name, i, _coefficient(oscillator, path)) for i, (name, path) in enumerate(pairs))


def _parts(path: Sequence) -> list[str]:
    """Return the names along a path.

    Laws of a sum and elements of a list are numbered, for example ``forces_3``.
    """
    parts: list[str] = []
    inside_sum = False
    for key in path:
        if not hasattr(key, "name"):
            parts = [*parts, str(key.idx)] if inside_sum else [*parts[:-1], f"{parts[-1]}_{key.idx}"]
        elif key.name != "laws":
            parts.append(key.name)
        inside_sum = getattr(key, "name", None) == "laws"
    return parts


def _coefficient(oscillator: Oscillator, path: Sequence) -> Coefficient:
    """Return the description of a leaf from the object that owns it.

    Elements of a list share the description of the list.
    """
    named = max(i for i, key in enumerate(path) if hasattr(key, "name"))
    owner: Any = oscillator
    for key in path[:named]:
        owner = getattr(owner, key.name) if hasattr(key, "name") else owner[key.idx]
    return owner.coefficients[path[named].name]


class AbstractRelease(eqx.Module):
    """Holding force that decays from the moment of release.

    Examples:
        >>> issubclass(ExponentialRelease, AbstractRelease)
        True
    """

    @abc.abstractmethod
    def force(self, t: Scalar, hold: Scalar) -> Scalar:
        """Return the remaining force [N] at time `t` [s] after release.

        Before release `hold` [N] balances the spring.
        """


class ExponentialRelease(AbstractRelease):
    """Electromagnet with a force that decays as ``exp(-t/time_constant)``.

    Attributes:
        time_constant: decay time of the force [s]; 0.5 to 3 ms for a small holding magnet.

    Examples:
        >>> release = ExponentialRelease(time_constant=2e-3)
        >>> print(f"{release.force(jnp.asarray(2e-3), hold=jnp.asarray(10.0)):.3f} N are left")
        3.679 N are left
    """

    time_constant: Scalar = eqx.field(converter=scalar)

    def force(self, t: Scalar, hold: Scalar) -> Scalar:
        return hold * jnp.exp(-t / self.time_constant)


class Drive(eqx.Module):
    """External excitation of the mass.

    Attributes:
        t: times of the floor acceleration samples [s], shape (instants,).
        base_acceleration: floor acceleration [m/s^2], interpolated linearly; None for a fixed floor.
        release: decay law of the holding force.
    """

    t: Float[Array | np.ndarray, " instants"]
    base_acceleration: Float[Array | np.ndarray, " instants"] | None = None
    release: AbstractRelease | None = None
