"""Decays and their derivatives by SciPy from laws in plain NumPy.

DOP853 integrates each half-cycle together with its variational equations. Derivatives of the forces come from complex
steps. Nothing here uses the package except the values of coefficients.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from fricjax.friction import AbstractFriction, MonotoneSpline
from fricjax.friction.base import laws_of
from fricjax.friction.spline import AbstractSpline
from fricjax.oscillator import Oscillator
from fricjax.oscillator.oscillator import leaves_of

type Numbers = Mapping[str, np.ndarray]
type Force = Callable[[Numbers, np.ndarray], np.ndarray]
STEP = 1e-30
"""Complex step, relative to the value."""
SLOWEST = 1e-8
"""Speed below which slopes of the resisting force are secants, over that of the undamped motion. Much lower speeds last
for less time than the smallest step of the integrator."""


class Truth(NamedTuple):
    """Displacement, derivatives by coefficients and x0, turning points, and stop."""

    x: np.ndarray
    columns: np.ndarray
    turning_points: np.ndarray
    stopped: bool


def _exponential(p: Numbers, u: np.ndarray) -> np.ndarray:
    return np.exp(-((u / p["v_stribeck"]) ** p["exponent"]))


def _lorentzian(p: Numbers, u: np.ndarray) -> np.ndarray:
    return 1 / (1 + (u / p["v_stribeck"]) ** p["exponent"])


def _falling(p: Numbers, fall: np.ndarray) -> np.ndarray:
    static = p.get("mu_s", p["mu"])
    return p["normal_force"] * (p["mu"] + (static - p["mu"]) * fall)


def _makkar(p: Numbers, u: np.ndarray) -> np.ndarray:
    hump = np.tanh(p["gamma2"] * u) - np.tanh(p["gamma3"] * u)
    return p["normal_force"] * (p["gamma1"] * hump + p["gamma4"] * np.tanh(p["gamma5"] * u)) + p["gamma6"] * u


def _spline(p: Numbers, knots: Sequence[float], monotone: bool) -> Force:
    """Return the cubic through the values in ln(1 + u/u_1).

    It has no curvature at zero and no slope at the last knot.
    """
    forces = np.stack([p[f"forces_{i}"] for i in range(len(knots))])
    s = np.log1p(np.asarray(knots) / knots[1])
    h, n = np.diff(s), len(knots)
    rises = np.diff(forces, axis=0) / h[:, None]
    matrix, right = np.eye(n, dtype=complex), np.zeros_like(forces, dtype=complex)
    matrix[0, :2], right[0] = (2, 1), 3 * rises[0]
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = h[i], 2 * (h[i - 1] + h[i]), h[i - 1]
        right[i] = 3 * (h[i] * rises[i - 1] + h[i - 1] * rises[i])
    slopes = np.linalg.solve(matrix, right)
    if monotone:
        around = 3 * np.stack([np.concatenate([rises[:1], rises]), np.concatenate([rises, rises[-1:]])])
        order = np.argsort(around.real, axis=0)
        least, most = (np.take_along_axis(around, order[i : i + 1], 0)[0] for i in (0, 1))
        # Where a bound is zero, its derivative is the mean of both sides, as in a central difference.
        bottom = np.where(most.real < 0, most, np.where(most.real == 0, most / 2, 0.0))
        top = np.where(least.real > 0, least, np.where(least.real == 0, least / 2, 0.0))
        slopes = np.where(slopes.real < bottom.real, bottom, slopes)
        slopes = np.where(slopes.real > top.real, top, slopes)

    def force(p: Numbers, u: np.ndarray) -> np.ndarray:
        i = int(np.clip(np.searchsorted(knots, u[1].real, side="right") - 1, 0, n - 2))
        w = (np.log1p(u / knots[1]) - s[i]) / h[i] if u[1].real < knots[-1] else np.ones_like(u)
        value = (1 + 2 * w) * (1 - w) ** 2 * forces[i] + w**2 * (3 - 2 * w) * forces[i + 1]
        value = value + h[i] * (w * (1 - w) ** 2 * slopes[i] - w**2 * (1 - w) * slopes[i + 1])
        return p["normal_force"] * value

    return force


def friction_of(law: AbstractFriction, numbers: Numbers) -> Force:
    """Return the sliding force [N] from numbers and speed [m/s]."""
    if isinstance(law, AbstractSpline):
        return _spline(numbers, law.knots, isinstance(law, MonotoneSpline))
    formulas: dict[str, Force] = {
        "Coulomb": lambda p, u: p["mu"] * p["normal_force"] + 0 * u,
        "LoadDependent": lambda p, u: (
            p["mu"] * p["reference_load"] * (p["normal_force"] / p["reference_load"]) ** p["exponent"]
            + p["adhesion"]
            + 0 * u
        ),
        "Viscous": lambda p, u: p["sigma2"] * u,
        "QuadraticDrag": lambda p, u: p["quadratic_drag"] * u**2,
        "Stribeck": lambda p, u: _falling(p, _exponential(p, u)),
        "Lorentzian": lambda p, u: _falling(p, _lorentzian(p, u)),
        "Tanh": lambda p, u: p["mu"] * p["normal_force"] * np.tanh(u / p["v_s"]),
        "Makkar": _makkar,
    }
    return formulas[type(law).__name__]


def _restoring(name: str, p: Numbers, x: np.ndarray) -> np.ndarray:
    if name == "Pendulum":
        return p["stiffness"] * np.sin(x)
    return p["stiffness"] * x + (p["k3"] * x**3 if name == "Cubic" else 0.0)


class Machine:
    """Forces per mass of a machine with their derivatives.

    Attributes:
        names: coefficients for the derivatives.
        static: largest force per mass that holds the mass; zero for a smooth law.
        onset: friction force per mass of the set-valued limit as sliding begins.
    """

    def __init__(self, oscillator: Oscillator, names: Sequence[str], x0: float) -> None:
        import jax

        leaves = [float(leaf) for leaf in jax.tree.leaves(oscillator)]
        values = {leaf.name: leaves[leaf.index] for leaf in leaves_of(oscillator)}
        self.names, self.scales = tuple(names), np.array([abs(values[name]) or 1.0 for name in names])
        rows = len(names) + 3
        self.numbers: dict[str, np.ndarray] = {name: np.full(rows, value, complex) for name, value in values.items()}
        for row, (name, scale) in enumerate(zip(names, self.scales, strict=True), 3):
            self.numbers[name][row] += 1j * STEP * scale
        self._laws = [friction_of(law, self.numbers) for law in laws_of(oscillator.friction)]
        self._spring = type(oscillator.restoring).__name__
        self.kinked = self._spring == "Structural"
        self.period = 2 * np.pi * np.sqrt(values["mass"] / values["stiffness"])
        self.slowest = SLOWEST * abs(x0) * 2 * np.pi / self.period
        load, mass = float(oscillator.normal_force), float(oscillator.mass)
        self.static = float(oscillator.friction.static_force(np.float64(load))) / mass
        self.onset = (
            float(oscillator.friction.set_valued_limit().sliding_force(np.float64(0.0), np.float64(load))) / mass
        )

    def forces(self, u: float, x: float) -> tuple[float, float, np.ndarray, float, float, np.ndarray, float, float]:
        """Return the resisting, restoring and internal forces with derivatives.

        They are D, dD/du, columns of D; r, dr/dx, columns of r; internal friction of the spring and its slope. Columns
        are derivatives by the logarithm of each coefficient.
        """
        p = self.numbers
        # Row 0 has the complex step in speed and displacement, row 1 none, row 2 no speed; the others have the steps of
        # the coefficients. A power of the speed below one has an infinite slope at zero, so below SLOWEST the
        # slope is that of the secant.
        size = max(u, self.slowest)
        us, xs = np.full(len(self.names) + 3, u, complex), np.full(len(self.names) + 3, x, complex)
        us[0], us[2], xs[0] = size * (1 + 1j * STEP), 0.0, x + 1j * STEP
        resisting = p["damping"] * us + p["drag"] * us**2 + sum(law(p, us) for law in self._laws)
        resisting, restoring = resisting / p["mass"], _restoring(self._spring, p, xs) / p["mass"]
        inner = 0 * xs
        if self.kinked:
            inner = p["eta_h"] * p["stiffness"] * np.where(xs.real < 0, -xs, xs) / p["mass"]
        slope = (resisting[0] - resisting[2]).real / size if u < size else resisting[0].imag / (STEP * size)
        return (
            (resisting[1] + inner[1]).real, slope, (resisting + inner)[3:].imag / STEP,
            restoring[1].real, restoring[0].imag / STEP, restoring[3:].imag / STEP,
            inner[1].real, inner[0].imag / STEP,
        )  # fmt: skip


def decay(
    oscillator: Oscillator, names: Sequence[str], x0: float, ts: np.ndarray, *, derivatives: bool = True,
    rtol: float = 1e-12, most: int = 1000,
) -> Truth:  # fmt: skip
    """Integrate from rest at `x0` to the last sample, or to rest.

    Columns are derivatives by each name and by `x0`. A smooth law ends when friction holds the mass but for its creep.
    """
    machine = Machine(oscillator, names if derivatives else (), x0)
    count = len(machine.names) + 1 if derivatives else 0
    x, columns = np.full(ts.shape, np.nan), np.full((ts.size, count), np.nan)
    y, t, points = np.zeros(2 + 2 * count), 0.0, [x0]
    y[0] = x0
    if count:
        y[1 + count] = x0
    rate = 2 * np.pi / machine.period
    atol = np.append([abs(x0), abs(x0) * rate], np.repeat([abs(x0), abs(x0) * rate], count)) * 1e-3 * rtol
    holds = machine.static or 2.2 * machine.onset
    while t < ts[-1] and len(points) <= most:
        side = 1.0 if y[0] >= 0 else -1.0
        start = machine.forces(0.0, y[0])
        if abs(start[3]) - start[6] <= holds:
            break
        y, t = _half_cycle(machine, side, y, t, ts, x, columns, rtol, atol)
        points.append(y[0])
    stopped = t < ts[-1] and machine.static > 0 and len(points) <= most
    if stopped:
        x[ts > t], columns[ts > t] = y[0], y[2 : 2 + count]
    scales = np.append(machine.scales, x0) if count else 1.0
    return Truth(x, columns / scales, np.array(points), stopped)


def _half_cycle(
    machine: Machine, side: float, y: np.ndarray, t: float, ts: np.ndarray, x: np.ndarray, columns: np.ndarray,
    rtol: float, atol: np.ndarray,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Integrate to the next reversal and write the samples."""
    count = columns.shape[1]

    def acceleration(state: np.ndarray, direction: float) -> float:
        forces = machine.forces(0.0, state[0])
        return direction * forces[0] - forces[3]

    def rates(_t: float, state: np.ndarray) -> np.ndarray:
        resisting, by_u, by_p, restoring, by_x, restoring_by_p, _, inner = machine.forces(
            max(-side * state[1], 0.0), state[0]
        )
        change = np.empty_like(state)
        change[0], change[1] = state[1], side * resisting - restoring
        if count:
            dx, dv = state[2 : 2 + count], state[2 + count :]
            change[2 : 2 + count] = dv
            change[2 + count :] = (side * inner - by_x) * dx - by_u * dv
            change[2 + count : -1] += side * by_p - restoring_by_p
        return change

    def reversal(time: float, state: np.ndarray) -> float:
        return -side * state[1] + (1e-30 if time == t else 0.0)

    def passing(_t: float, state: np.ndarray) -> float:
        return side * state[0]

    def leg(begin: np.ndarray, t: float, event: Callable[[float, np.ndarray], float]) -> tuple[np.ndarray, float, bool]:
        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        result = solve_ivp(
            rates, (t, t + 1e3 * machine.period), begin, "DOP853", events=[event, reversal], dense_output=True,
            rtol=rtol, atol=atol, max_step=machine.period / 40,
        )  # fmt: skip
        if result.status != 1:
            raise RuntimeError(f"SciPy gave up at {result.t[-1]} s: {result.message}")
        end = result.t[-1]
        # The interpolant of the last step is poor for a power law, so integrate its part before the event once more.
        last = solve_ivp(rates, (result.t[-2], end), result.y[:, -2], "DOP853", rtol=rtol, atol=atol)
        inside = (ts >= t) & (ts <= end)
        if inside.any():
            values = result.sol(ts[inside])
            x[inside], columns[inside] = values[0], values[2 : 2 + count].T
        return last.y[:, -1], end, bool(result.t_events[1].size)

    reversal.terminal, reversal.direction = True, -1  # type: ignore[attr-defined]
    state, end, over = y.copy(), t, False
    state[1] = -side * 1e-2 * atol[1]
    # Internal friction of the spring has a kink at the equilibrium. The last half-cycle may end before it.
    if machine.kinked and side * state[0] > 0:
        state, end, over = leg(state, t, passing)
    if not over:
        state, end, _ = leg(state, end, reversal)
    # The reversal shifts by -dv/a, and the acceleration jumps there.
    if count:
        state[2 + count :] *= acceleration(state, -side) / acceleration(state, side)
    state[1] = 0.0
    return state, end
