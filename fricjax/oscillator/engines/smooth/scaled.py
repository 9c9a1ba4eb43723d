"""A machine in the units in which its motion is integrated.

State and time are scaled by the amplitude, the natural frequency and the law's own deflection, so that one tolerance
fits every component: with raw bristle deflections of a nanometre beside millimetres none does.
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

# How much larger the tolerance of an internal state may be than that of the displacement, at most.
_LOOSEST = 1000.0
_FIRST_STEP = 1e-9


class Rates(NamedTuple):
    """Scaled acceleration, and scaled rate of each internal state."""

    acceleration: Array
    states: tuple[Array, ...]


class Scaled(eqx.Module):
    """An oscillator with the units of displacement [m], of the inverse of time [1/s] and of the internal states.

    Motions are tuples of scaled displacement, velocity and internal states; x, v and the states are passed apart.

    Attributes:
        floor: acceleration of the floor over scaled time [m/s^2], None where it stands.
        release, holding: law by which the holding force decays, and what it was [N]; None without one.
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
        """The units for a motion from `start`, and what drives it."""
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
        """Force of floor and release on the mass [N]."""
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
        """The start as a scaled motion."""
        y0 = (start.x0 / self.length, start.v0 / self.speed, *(start.state / self.state))
        return jax.tree.map(jnp.asarray, y0)

    def rates(self, x: Array, v: Array, states: tuple) -> Rates:
        """The rates of a free motion."""
        a, z = self.oscillator.rates(x * self.length, v * self.speed, self._unscaled(states))
        z = z / (self.state * self.rate)
        return Rates(a / (self.speed * self.rate), tuple(z[i] for i in range(len(states))))

    def mapped(self, x: Array, v: Array, states: tuple, before: tuple) -> tuple:
        """The internal states from which the next step begins, by the law's return map and within its reach.

        They were `before` when the step began, which a start may have put beyond that reach.
        """
        law, load = self.oscillator.friction, self.oscillator.normal_force
        most = jnp.maximum(law.reach(load), jnp.abs(self._unscaled(before)))
        limited = jnp.clip(self._unscaled(states), -most, most)
        a = self.rates(x, v, states).acceleration * self.speed * self.rate
        return tuple(law.return_map(v * self.speed, a, limited, load) / self.state)

    def switches(self, v: Array, states: tuple) -> Array:
        """What the law switches by besides the velocity."""
        load = self.oscillator.normal_force
        return self.oscillator.friction.switches(v * self.speed, self._unscaled(states), load)

    def settling(self, x: Array, v: Array, states: tuple) -> tuple[Array, Array]:
        """Where a contact will hold the mass, and the longest way that the mass can still go; inf where none holds it.

        A contact of stiffness K holds the mass at ``x + m a/(k + K)``, where a is the acceleration at zero velocity
        with the same states. About there the mass rings, and while the contact yields, what is left of its energy is
        spent on a way against the force by which friction is stronger than the spring.
        """
        ratio = 1 + jnp.maximum(self._stiffness(self._unscaled(states)), 0.0) / self.oscillator.stiffness
        away = self.rates(x, jnp.zeros(()), states).acceleration / ratio
        energy = (v**2 + ratio * away**2) / 2
        spare = (self.hold - jnp.abs(self.pull(x + away))) / (self.oscillator.stiffness * self.length)
        way = jnp.sqrt(2 * energy / ratio) + energy / jnp.where(spare > 0, spare, 1.0)
        return x + away, jnp.where(spare > 0, way, jnp.inf)

    @property
    def contact_stiffness(self) -> Array:
        """Stiffness of a contact that is not bent [N/m]."""
        return self._stiffness(jnp.zeros(self.oscillator.friction.n_states))

    def _stiffness(self, state: Array) -> Array:
        """Stiffness of the contact with these internal states [N/m]."""
        law, load, still = self.oscillator.friction, self.oscillator.normal_force, jnp.zeros(())
        _, bent = jax.jvp(lambda speed: law.rate(speed, state, load), (still,), (jnp.ones(()),))
        return jax.jvp(lambda z: law.force(still, z, load), (state,), (bent,))[1]

    @property
    def hold(self) -> Array:
        """The largest force that friction holds against [N]."""
        law, load = self.oscillator.friction, self.oscillator.normal_force
        return jnp.maximum(law.static_force(load), law.dynamic_force(load))

    def pull(self, x: Array) -> Array:
        """Force of the spring [N]."""
        return self.oscillator.restoring_force(x * self.length)

    def nodes(self, tau: Array, x: Array, v: Array, states: tuple) -> Nodes:
        """Nodes at scaled times from the motion there, which goes on behind the last one."""
        a = jax.vmap(lambda x, v, states: self.rates(x, v, states).acceleration)(x, v, states)
        columns = (tau / self.rate, x * self.length, v * self.speed, a * self.speed * self.rate)
        return Nodes.of(columns, columns[1][-1], columns[0][-1], jnp.asarray(False))

    def _unscaled(self, states: tuple) -> Array:
        return jnp.stack(states) * self.state if states else jnp.zeros(0)


def continued(ts: Array, start: Start, acceleration: Array | None, x: Array, v: Array) -> tuple[Array, Array]:
    """Displacement and velocity at `ts`, from those at time zero and later.

    A parabola of that `acceleration` continues a free motion backwards, so that a fit which moves the instant of its
    start sees a smooth motion. A driven one is that of a mass which was held until time zero: it has none.
    """
    if acceleration is None:
        return x, jnp.where(ts < 0, 0.0, v)
    early = jnp.minimum(ts, 0.0)
    return x + early * (start.v0 + early * acceleration / 2), v + early * acceleration


def _state_units(oscillator: Oscillator, length: Array) -> Array:
    """The law's own scales, larger by as much as their errors matter less than those of the displacement.

    A contact that settles over the travel l does so within the scaled time sqrt(2 l/a) of a reversal at the amplitude
    a. A relative error of its state changes the velocity there by that times x_d, the dead band, at amplitudes down
    to x_d: by sqrt(2 l x_d) over the amplitude of the start. Behind that travel nothing is left of it.
    """
    law, load = oscillator.friction, oscillator.normal_force
    unit = jnp.maximum(law.state_scale(load), jnp.finfo(float).tiny)
    if not law.n_states or not law.has_fading_memory:
        return unit
    travel = unit / jnp.abs(law.rate(jnp.ones(()), jnp.zeros(law.n_states), load))
    felt = jnp.sqrt(2 * travel * oscillator.dead_band) / length
    return unit * jnp.clip(1 / felt, 1.0, _LOOSEST)


class Cautious(diffrax.PIDController):
    """Steps chosen by their error, the first of them tiny.

    At rest a contact of the rate-and-state kind is so stiff that a first step of ordinary size hardly moves the mass,
    and no error estimate of such a step sees that a true contact gives way. Behind a reversal the steps are small
    anyway. Of a step that it is given itself, diffrax has the host check the sign, and what calls the host is no
    program that can be kept.
    """

    def init(
        self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: None, args: Any, func: Any, error_order: Any
    ) -> tuple[Any, Any]:
        return super().init(terms, t0, t1, y0, jnp.asarray(_FIRST_STEP), args, func, error_order)


def integrate(field: Any, solver: Any, begin: Any, end: Any, y0: tuple, args: Any, **settings: Any) -> Any:
    """Solution of a scaled motion, differentiable forwards; one that fails says so in its result.

    `settings` are those of `diffrax.diffeqsolve`; the first step is the controller's.
    """
    how = {"dt0": None, "adjoint": diffrax.ForwardMode(), "throw": False, **settings}
    return diffrax.diffeqsolve(diffrax.ODETerm(field), solver, begin, end, y0=y0, args=args, **how)
