"""Closed-form half-cycles for Coulomb friction, viscous damping and a linear spring.

Between two reversals the mass oscillates about the centre ``s x_d`` shifted by friction. Each half-cycle multiplies the
distance to it by ``-rho = -exp(-pi zeta/sqrt(1 - zeta^2))`` in the time ``pi/omega_d``, for any friction force (Feeny
and Liang, J. Sound Vib. 195, 1996). The map of the alternating amplitude ``a_n = (-1)^n s_0 y_n`` of the turning points
is linear, ``a_n = rho^n a_0 - (1 + rho) x_d S_n`` with ``S_n = (1 - rho^n)/(1 - rho)``. The state at any time therefore
follows without a loop.
"""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...friction.base import Scalar
from ...friction.kinds import AbstractConstant
from ..motion import Motion, Start
from ..oscillator import Oscillator
from ..restoring import Linear
from .base import AbstractEngine, AbstractPath, Demands
from .elementary import relative_expm1, swing


@jax.custom_jvp
def _without_drag(motion: Array, drag: Scalar) -> Array:
    """Return the motion; its derivative with respect to drag is NaN."""
    return motion


@_without_drag.defjvp
def _without_drag_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    motion_dot, drag_dot = tangents
    return primals[0], motion_dot + jnp.where(drag_dot == 0, 0.0, jnp.nan)


class HalfCycles(AbstractPath):
    """Sequence of half-cycles from a real or virtual turning point.

    Attributes:
        damped_frequency: omega_d [rad/s].
        dead_band: half-width x_d of the band in which dynamic friction balances the spring [m].
        log_decrement: logarithm of the ratio of successive distances to the shifted centre.
        side, amplitude: sign and alternating amplitude of the first turning point [m].
        elapsed: time from that turning point to the start [s].
        last: number of half-cycles to rest; inf if the mass never rests, NaN if the closed form does not apply.
        drag: quadratic drag of the oscillator; its derivative is unavailable.
        capacity: number of half-cycles in the list of turning points.
    """

    damped_frequency: Scalar
    dead_band: Scalar
    log_decrement: Scalar
    side: Scalar
    amplitude: Scalar
    elapsed: Scalar
    last: Scalar
    drag: Scalar
    capacity: int = eqx.field(static=True)

    @property
    def turning_points(self) -> Float[Array, " turning_points"]:
        n = jnp.arange(self.capacity + 1.0)
        points = jnp.where(n <= self.last, self.side_of(n) * self.alternating_amplitude(n), jnp.nan)
        return _without_drag(points, self.drag)

    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        n = self.count_at(ts)
        # At rest the phase grows without bound, and reverse mode would multiply its zero weight by infinity.
        at_rest = n >= self.last
        phase = jnp.where(at_rest, 0.0, self.damped_frequency * (ts + self.elapsed) - n * jnp.pi)
        n, side = jax.lax.optimization_barrier((n, self.side_of(n)))
        point = self.alternating_amplitude(n)
        deflection, rate = swing(phase, -self.log_decrement / jnp.pi)
        distance = point - self.dead_band
        x = side * jnp.where(at_rest, point, self.dead_band + distance * deflection)
        v = side * jnp.where(at_rest, 0.0, -distance * self.damped_frequency * rate)
        return _without_drag(x, self.drag), _without_drag(v, self.drag)

    def count_at(self, ts: Array) -> Array:
        """Return the number of half-cycles completed at `ts`."""
        n = jnp.floor((ts + self.elapsed) / self.half_period)
        return jax.lax.stop_gradient(jnp.clip(n, 0.0, self.last))

    def side_of(self, n: Array) -> Array:
        """Return the sign of turning point n."""
        return self.side * jnp.where(n % 2 == 0, 1.0, -1.0)

    @property
    def t_stop(self) -> Scalar:
        """Time of the stop [s], inf for none."""
        finite = jnp.isfinite(self.last)
        stop = jnp.where(finite, self.last, 0.0) * self.half_period - self.elapsed
        return jnp.where(finite, stop, jnp.inf)

    @property
    def half_period(self) -> Scalar:
        return jnp.pi / self.damped_frequency

    def alternating_amplitude(self, n: Array) -> Array:
        """Return the alternating amplitude a_n of turning point n [m]."""
        q = self.log_decrement
        growth = relative_expm1(n * q)
        total = n * growth / relative_expm1(q)
        return (1 + n * q * growth) * self.amplitude - (1 + jnp.exp(q)) * self.dead_band * total

    def half_cycles_to_rest(self, static_band: Scalar, breakaway_band: Scalar, moving: Array) -> Array:
        """Return the number of half-cycles until |a_n| is within the static band.

        It is inf if that never happens, and at least one for a mass in motion. From rest, the first half-cycle requires
        a deflection beyond the breakaway band.
        """
        q = self.log_decrement
        gain = -jnp.expm1(q)
        width = static_band * gain + self.dead_band * (1 + jnp.exp(q))
        undamped = (self.amplitude - static_band) / jnp.where(width > 0, width, jnp.inf)
        # Without damping the amplitudes fall linearly, and the formula for a decay becomes 0/0.
        damped = jnp.abs(q) > 1e-9
        q_safe = jnp.where(damped, q, -1.0)
        count = jnp.where(damped, jnp.log1p(undamped * gain) / -q_safe, undamped)
        count = jnp.where((width > 0) & jnp.isfinite(count), jnp.maximum(jnp.ceil(count), 0.0), jnp.inf)
        count = jnp.where(self.amplitude <= static_band, 0.0, count)
        finite = jnp.where(jnp.isfinite(count), count, 0.0)
        # Rounding may change the count by one; the rest condition decides.
        early = (finite > 0) & (self.alternating_amplitude(finite - 1) <= static_band)
        late = self.alternating_amplitude(finite) > static_band
        count = count - early + late
        sticks = self.amplitude <= breakaway_band
        return jax.lax.stop_gradient(jnp.where(moving, jnp.maximum(count, 1.0), jnp.where(sticks, 0.0, count)))


def _begin(oscillator: Oscillator, start: Start, capacity: int) -> tuple[HalfCycles, Array]:
    """Extend the motion back to a virtual turning point.

    Returns:
        The half-cycles, and whether the mass moves at the start.
    """
    omega, zeta = oscillator.angular_frequency, oscillator.damping_ratio
    root = jnp.sqrt(1 - zeta**2)
    moving = start.v0 != 0
    side = jnp.where(moving, -jnp.sign(start.v0), jnp.where(start.x0 < 0, -1.0, 1.0))
    offset = side * start.x0 - oscillator.dead_band
    sine = -side * start.v0 * root / omega
    cosine = offset + zeta * side * start.v0 / omega
    guarded = moving | (cosine > 0)
    phase = jnp.arctan2(jnp.where(guarded, sine, 0.0), jnp.where(guarded, cosine, 1.0))
    distance = jnp.sqrt(jnp.where(guarded, sine**2 + cosine**2, 1.0))
    virtual = jnp.where(guarded, distance * jnp.exp(zeta * phase / root), offset)
    cycles = HalfCycles(
        damped_frequency=omega * root,
        dead_band=oscillator.dead_band,
        log_decrement=-jnp.pi * zeta / root,
        side=jax.lax.stop_gradient(side),
        amplitude=virtual + oscillator.dead_band,
        elapsed=phase / (omega * root),
        last=jnp.asarray(jnp.inf),
        drag=oscillator.drag,
        capacity=capacity,
    )
    return cycles, moving


class Exact(AbstractEngine):
    """Closed form for Coulomb friction, viscous damping and a linear spring.

    The only error is rounding.

    Attributes:
        max_half_cycles: length of the list of turning points; the motion has no such limit.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> motion = fj.simulate(oscillator, 2e-3, np.asarray([0.0, 1.0]), engine=Exact(max_half_cycles=16))
        >>> motion.turning_points.shape
        (17,)
    """

    name: ClassVar[str] = "exact"
    needs_mesh: ClassVar[bool] = False
    max_half_cycles: int = eqx.field(static=True, default=512)

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        if not isinstance(oscillator.friction, AbstractConstant):
            return f"The exact engine knows Coulomb friction only, not {type(oscillator.friction).__name__}."
        if not isinstance(oscillator.restoring, Linear):
            return f"The exact engine knows the linear spring only, not {type(oscillator.restoring).__name__}."
        if isinstance(oscillator.drag, np.ndarray) and np.any(oscillator.drag != 0):
            value = "free" if np.any(np.isnan(oscillator.drag)) else oscillator.drag
            return f"The exact engine has no quadratic drag, but drag is {value}. Use the hybrid engine."
        return None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Exact":
        # Capacity costs nothing here, so all records share one.
        return Exact(max(Exact().max_half_cycles, self.max_half_cycles))

    def finer(self) -> "Exact":
        return self

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> HalfCycles:
        cycles, moving = _begin(oscillator, start, self.max_half_cycles)
        if half_cycles is None:
            law, load, stiffness = oscillator.friction, oscillator.normal_force, oscillator.stiffness
            static, breakaway = law.static_force(load) / stiffness, law.breakaway_force(load) / stiffness
            last = cycles.half_cycles_to_rest(static, breakaway, moving)
        else:
            last = half_cycles.astype(float)
        supported = (oscillator.drag == 0) & (oscillator.damping_ratio < 1)
        return eqx.tree_at(lambda c: c.last, cycles, jnp.where(supported, last, jnp.nan))

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        from ..outcome import RESULTS

        cycles = self.path(oscillator, start, half_cycles)
        x, v = cycles.sample(ts)
        n = cycles.count_at(ts)
        at_rest = n >= cycles.last
        sliding = -cycles.side_of(n) * oscillator.friction.dynamic_force(oscillator.normal_force)
        outcome: Any = RESULTS.successful
        outcome = RESULTS.where(oscillator.drag == 0, outcome, RESULTS.drag_unsupported)
        # The virtual turning point of a start in motion is not its start position.
        points = cycles.turning_points.at[0].set(jnp.where(jnp.isnan(cycles.last), jnp.nan, start.x0))
        return Motion(
            t=ts,
            x=x,
            v=v,
            friction_force=jnp.where(at_rest, -oscillator.restoring_force(x), sliding),
            at_rest=at_rest,
            t_stop=_without_drag(cycles.t_stop, oscillator.drag),
            turning_points=_without_drag(points, oscillator.drag),
            n_half_cycles=jnp.where(jnp.isfinite(cycles.last), cycles.last, -1).astype(int),
            regularisation_bias=jnp.zeros(()),
            engine=self.name,
            result=RESULTS.where(oscillator.damping_ratio < 1, outcome, RESULTS.overdamped),
            stats={},
        )
