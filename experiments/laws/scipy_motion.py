"""Motions of a mass on a spring by SciPy.

Laws are in plain Python numbers. From one reversal to the next the direction of motion is known, so that no rate has a
kink or a jump. `restarted` integrates from reversal to reversal. `direct` integrates across the reversals in one call.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import odeint, solve_ivp


class Machine(NamedTuple):
    """An oscillator with linear spring and viscous damping, in SI units."""

    mass: float
    stiffness: float
    damping: float
    normal_force: float


class Law(NamedTuple):
    """A law at a given load.

    `d` is the direction of motion: +1, -1, or 0 at rest.

    Attributes:
        act: function of v, the internal states z and d; returns the force, which opposes a positive v, and state rates.
        scale: size of each state.
        pulled: function of a direction; returns the states after a slow pull.
        static: force that holds a mass at rest in addition to the forces of the states [N].
    """

    act: Callable[[float, Sequence[float], float], tuple[float, ...]]
    scale: tuple[float, ...] = ()
    pulled: Callable[[float], tuple[float, ...]] = lambda d: ()
    static: float = 0.0


def _start(machine: Machine, law: Law, x0: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the state at time zero, and the size of its components."""
    scale = [abs(x0), abs(x0) * np.sqrt(machine.stiffness / machine.mass), *law.scale]
    return np.array([x0, 0.0, *law.pulled(float(np.sign(x0)))]), np.array(scale)


def restarted(
    law: Law, machine: Machine, x0: float, ts: np.ndarray, *, rtol: float = 1e-12, method: str = "LSODA"
) -> np.ndarray:
    """Integrate from reversal to reversal.

    The mass is released at rest from `x0` [m]. Before the release the contact was pulled there slowly.

    Args:
        law: the law at the machine's load.
        machine: the oscillator.
        x0: displacement at time zero, not zero.
        ts: increasing times [s] from zero on, shape (samples,).
        rtol: relative tolerance; also the absolute one, in units of the amplitude and of the size of the states.
        method: a method of `solve_ivp`, such as LSODA or Radau.

    Returns:
        Displacement [m] at `ts`, shape (samples,).
    """
    y, scale = _start(machine, law, x0)
    x, t = np.full(ts.shape, float(x0)), 0.0
    while t < ts[-1]:
        pull = -machine.stiffness * y[0] - law.act(0.0, y[2:].tolist(), 0.0)[0]
        if abs(pull) <= law.static:
            x[ts > t] = y[0]
            return x
        field, reversal = _field(law, machine, 1.0 if pull > 0 else -1.0), _reversal(pull)
        stroke = solve_ivp(
            field, (t, ts[-1]), y, method, events=reversal, dense_output=True, rtol=rtol, atol=rtol * scale
        )
        _demand_success(stroke)
        end = stroke.t[-1]
        inside = (ts > t) & (ts <= end)
        x[inside] = stroke.sol(ts[inside])[0] if inside.any() else ()
        t, y = end, np.array([stroke.y[0, -1], 0.0, *stroke.y[2:, -1]])
    return x


def direct(
    law: Law, machine: Machine, x0: float, ts: np.ndarray, *, rtol: float = 1e-12, method: str = "odeint"
) -> np.ndarray:
    """Integrate as `restarted`, but in one call across all reversals.

    `method` is odeint or a method of solve_ivp. Laws that hold the mass at rest by a jump cannot be integrated this
    way.
    """
    y0, scale = _start(machine, law, x0)
    field = _field(law, machine, None)
    if method == "odeint":
        return odeint(field, y0, ts, tfirst=True, rtol=rtol, atol=rtol * scale, mxstep=1_000_000)[:, 0]
    motion = solve_ivp(field, (0.0, ts[-1]), y0, method, t_eval=ts, rtol=rtol, atol=rtol * scale)
    _demand_success(motion)
    return motion.y[0]


def _demand_success(solution: Any) -> None:
    if not solution.success:
        raise RuntimeError(f"SciPy gave up at {solution.t[-1]} s: {solution.message}")


def _field(law: Law, machine: Machine, direction: float | None) -> Callable[[float, np.ndarray], Any]:
    """Return a function for the rates of x, v and the states.

    Without a direction it uses the sign of the velocity.
    """
    mass, stiffness, damping, _ = machine
    act = law.act

    def field(_t: float, y: np.ndarray) -> list[float]:
        x, v, *z = y.tolist()
        force, *rates = act(v, z, direction or (1.0 if v >= 0 else -1.0))
        return [v, -(stiffness * x + damping * v + force) / mass, *rates]

    return field


def _reversal(pull: float) -> Callable[[float, np.ndarray], float]:
    def reversal(_t: float, y: np.ndarray) -> float:
        return y[1]

    reversal.terminal, reversal.direction = True, -pull  # type: ignore[attr-defined]
    return reversal
