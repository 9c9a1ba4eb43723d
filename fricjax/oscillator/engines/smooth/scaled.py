"""Oscillator in scaled units for integration.

State and time are scaled by the amplitude, the natural frequency and the deflection scale of the law, so that one
tolerance suits every component. Unscaled, bristle deflections of nanometres and displacements of millimetres would
require different ones.
"""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ...motion import Start
from ...oscillator import AbstractRelease, Drive, Oscillator
from ..nodes import Nodes

# Largest ratio of the tolerance of an internal state to that of the displacement.
_LOOSEST = 1000.0
_FIRST_STEP = 1e-9


class Rates(NamedTuple):
    """Scaled acceleration and scaled rates of the internal states."""

    acceleration: Array
    states: tuple[Array, ...]


class Scaled(eqx.Module):
    """Oscillator with its units of displacement, inverse time and internal states.

    Motions are tuples of scaled displacement, velocity and internal states; methods take x, v and the states
    separately.

    Attributes:
        oscillator: the oscillator in SI units.
        length: unit of displacement [m].
        rate: inverse of the unit of time [1/s].
        state: units of the internal states, shape (states,).
        floor: acceleration of the floor over scaled time [m/s^2], None for a fixed floor.
        release, holding: decay law and initial value [N] of the holding force; None without one.
    """

    oscillator: Oscillator
    length: Array
    rate: Array
    state: Array
    floor: diffrax.LinearInterpolation | None = None
    release: AbstractRelease | None = None
    holding: Array | None = None

    @classmethod
    def of(cls, oscillator: Oscillator, start: Start, drive: Drive | None = None) -> "Scaled":
        """Choose the units for a motion from `start` with an optional drive."""
        rate = oscillator.angular_frequency
        floor, release = (None, None) if drive is None else (drive.base_acceleration, drive.release)
        reach = jnp.maximum(jnp.maximum(jnp.abs(start.x0), jnp.abs(start.v0) / rate), oscillator.dead_band)
        if floor is not None:
            reach = jnp.maximum(reach, jnp.max(jnp.abs(floor)) / rate**2)
        length = jnp.where(reach > 0, reach, 1.0)
        state = _state_units(oscillator, length)
        units = jax.lax.stop_gradient(length), rate, jax.lax.stop_gradient(state)
        holding = None if release is None else oscillator.restoring_force(start.x0)
        if drive is None or floor is None:
            return cls(oscillator, *units, None, release, holding)
        path = diffrax.LinearInterpolation(jnp.asarray(drive.t) * rate, floor)
        return cls(oscillator, *units, path, release, holding)

    def push(self, tau: Array) -> Array | float:
        """Return the force of floor and release on the mass [N]."""
        force: Array | float = 0.0
        if self.floor is not None:
            force = force - self.oscillator.mass * self.floor.evaluate(tau)
        if self.release is not None and self.holding is not None:
            force = force + self.release.force(tau / self.rate, self.holding)
        return force

    @property
    def speed(self) -> Array:
        """Unit of velocity [m/s]."""
        return self.length * self.rate

    @property
    def band(self) -> Array:
        """Scaled half-width of the dead band."""
        return self.oscillator.dead_band / self.length

    def start(self, start: Start) -> tuple:
        """Return the start as a scaled motion."""
        y0 = (start.x0 / self.length, start.v0 / self.speed, *(start.state / self.state))
        return jax.tree.map(jnp.asarray, y0)

    def rates(self, x: Array, v: Array, states: tuple) -> Rates:
        """Return the rates of a free motion."""
        a, z = self.oscillator.rates(x * self.length, v * self.speed, self._unscaled(states))
        z = z / (self.state * self.rate)
        return Rates(a / (self.speed * self.rate), tuple(z[i] for i in range(len(states))))

    def mapped(self, x: Array, v: Array, states: tuple, before: tuple) -> tuple:
        """Return the internal states at the start of the next step.

        The law's return map is applied and the states are clipped to their reach. A start may exceed the reach, so the
        states `before` the step extend it.
        """
        law, load = self.oscillator.friction, self.oscillator.normal_force
        most = jnp.maximum(law.reach(load), jnp.abs(self._unscaled(before)))
        limited = jnp.clip(self._unscaled(states), -most, most)
        a = self.rates(x, v, states).acceleration * self.speed * self.rate
        return tuple(law.return_map(v * self.speed, a, limited, load) / self.state)

    def switches(self, v: Array, states: tuple) -> Array:
        """Return the switching quantities of the law besides the velocity."""
        load = self.oscillator.normal_force
        return self.oscillator.friction.switches(v * self.speed, self._unscaled(states), load)

    def settling(self, x: Array, v: Array, states: tuple) -> tuple[Array, Array]:
        """Return where a contact will hold the mass, and its remaining distance.

        The distance is inf if the contact does not hold the mass. A contact of stiffness K holds the mass at
        ``x + m a/(k + K)``, where a is the acceleration at zero velocity with the same states. The mass vibrates about
        this point. While the contact yields, the remaining energy is dissipated over a distance by the excess of
        friction over the pull of the spring.
        """
        ratio = 1 + jnp.maximum(self._stiffness(self._unscaled(states)), 0.0) / self.oscillator.stiffness
        away = self.rates(x, jnp.zeros(()), states).acceleration / ratio
        energy = (v**2 + ratio * away**2) / 2
        spare = (self.hold - jnp.abs(self.pull(x + away))) / (self.oscillator.stiffness * self.length)
        way = jnp.sqrt(2 * energy / ratio) + energy / jnp.where(spare > 0, spare, 1.0)
        return x + away, jnp.where(spare > 0, way, jnp.inf)

    @property
    def contact_stiffness(self) -> Array:
        """Stiffness of the unloaded contact [N/m]."""
        return self._stiffness(jnp.zeros(self.oscillator.friction.n_states))

    def _stiffness(self, state: Array) -> Array:
        """Return the stiffness of the contact with these internal states [N/m]."""
        law, load, still = self.oscillator.friction, self.oscillator.normal_force, jnp.zeros(())
        _, bent = jax.jvp(lambda speed: law.rate(speed, state, load), (still,), (jnp.ones(()),))
        return jax.jvp(lambda z: law.force(still, z, load), (state,), (bent,))[1]

    @property
    def hold(self) -> Array:
        """Largest force that friction can hold [N]."""
        law, load = self.oscillator.friction, self.oscillator.normal_force
        return jnp.maximum(law.static_force(load), law.dynamic_force(load))

    def pull(self, x: Array) -> Array:
        """Return the force of the spring [N]."""
        return self.oscillator.restoring_force(x * self.length)

    def nodes(self, tau: Array, x: Array, v: Array, states: tuple) -> Nodes:
        """Return nodes at scaled times; the motion continues after the last one."""
        a = jax.vmap(lambda x, v, states: self.rates(x, v, states).acceleration)(x, v, states)
        columns = (tau / self.rate, x * self.length, v * self.speed, a * self.speed * self.rate)
        return Nodes.of(columns, columns[1][-1], columns[0][-1], jnp.asarray(False))

    def _unscaled(self, states: tuple) -> Array:
        return jnp.stack(states) * self.state if states else jnp.zeros(0)


def continued(ts: Array, start: Start, acceleration: Array | None, x: Array, v: Array) -> tuple[Array, Array]:
    """Extend displacement and velocity to times before zero.

    A free motion continues backwards as a parabola with this `acceleration`, so that a fit may move the start smoothly.
    A driven motion (`acceleration` None) was held until time zero.
    """
    if acceleration is None:
        return x, jnp.where(ts < 0, 0.0, v)
    early = jnp.minimum(ts, 0.0)
    return x + early * (start.v0 + early * acceleration / 2), v + early * acceleration


def _state_units(oscillator: Oscillator, length: Array) -> Array:
    """Return the units of the internal states.

    They are the law's scales, enlarged if state errors matter less than displacement errors. A contact that settles
    over the travel l does so within the scaled time sqrt(2 l/a) of a reversal at the amplitude a. A relative error of
    its state changes the velocity there by that time multiplied by the dead band x_d. At amplitudes down to x_d this is
    sqrt(2 l x_d), relative to the initial amplitude. After that travel the contact has forgotten the error.
    """
    law, load = oscillator.friction, oscillator.normal_force
    unit = jnp.maximum(law.state_scale(load), jnp.finfo(float).tiny)
    if not law.n_states or not law.has_fading_memory:
        return unit
    travel = unit / jnp.abs(law.rate(jnp.ones(()), jnp.zeros(law.n_states), load))
    felt = jnp.sqrt(2 * travel * oscillator.dead_band) / length
    return unit * jnp.clip(1 / felt, 1.0, _LOOSEST)


class Cautious(diffrax.PIDController):
    """PID step control with a tiny first step.

    At rest a rate-and-state contact is so stiff that a first step of ordinary size hardly moves the mass, and its error
    estimate would miss that a true contact yields. After a reversal the steps are small anyway. The first step is not
    passed to diffrax as `dt0`, because diffrax checks its sign by a host callback, and a program with host callbacks
    cannot be cached.
    """

    def init(
        self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: None, args: Any, func: Any, error_order: Any
    ) -> tuple[Any, Any]:
        return super().init(terms, t0, t1, y0, jnp.asarray(_FIRST_STEP), args, func, error_order)


def integrate(field: Any, solver: Any, begin: Any, end: Any, y0: tuple, args: Any, **settings: Any) -> Any:
    """Solve a scaled motion with forward-mode derivatives; failures appear in its result.

    `settings` are those of `diffrax.diffeqsolve`; the controller chooses the first step.
    """
    how = {"dt0": None, "adjoint": diffrax.ForwardMode(), "throw": False, **settings}
    return diffrax.diffeqsolve(diffrax.ODETerm(field), solver, begin, end, y0=y0, args=args, **how)
