"""Fit plain records of a linear oscillator with Coulomb friction.

Gauss-Newton steps on few samples lead from the rough decay close to the optimum, and one step on all samples to it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .decay import Evaluation, FreeDecay, evaluate
from .proof import limit, refusals, unfinished
from .start import rough_decays

RUN_COEFFICIENTS = ("t_release", "x0", "offset")
"""Coefficients of each run, which are always free."""

COEFFICIENTS = ("mass", "stiffness", "damping", "normal_force", "mu")
"""Coefficients of the machine that can be free."""

# Gauss-Newton steps on few samples. From a rough decay the error decreases to 1e-3 and 1e-6; one more is for safety.
_STEPS = 3
ITERATIONS = _STEPS + 1
"""Gauss-Newton steps of a fit."""

# Samples of a half-cycle for these steps.
_FEW = 12
_STRIDE = 8


class PlainFits(NamedTuple):
    """Fits of the runs that were proven plain.

    Attributes:
        runs: indices of these runs.
        values: fitted coefficients of the machine in the order of the names, then those of the run: time of the first
            reversal from the first sample [s], deflection there [m] and offset [m], shape (runs, names + 3).
        inverse: inverse of J'J for `values`, without the noise, shape (runs, names + 3, names + 3).
        normal: J'J, same shape.
        gradient: J'r, shape (runs, names + 3).
        remaining: length of the remaining step in standard errors, shape (runs,).
        noise: noise level from the residuals [m], shape (runs,).
        residuals: reading minus model of all samples [m], zero before the first reversal, shape (runs, samples).
        at: the decays.
        refused: for each test the indices of runs that fail it.
    """

    runs: np.ndarray
    values: np.ndarray
    inverse: np.ndarray
    normal: np.ndarray
    gradient: np.ndarray
    remaining: np.ndarray
    noise: np.ndarray
    residuals: np.ndarray
    at: Any
    refused: dict[str, np.ndarray]

    def only(self, which: np.ndarray) -> "PlainFits":
        """Return the fits of some runs."""
        few = {name: each[which] for name, each in self._asdict().items() if isinstance(each, np.ndarray)}
        return self._replace(**few, at=None if self.at is None else self.at.only(which))


def fit_plain(
    x: np.ndarray,
    dt: float,
    machine: Mapping[str, np.ndarray],
    free: Sequence[str],
    sigma: np.ndarray | None = None,
    lateness: np.ndarray | None = None,
    static: np.ndarray | None = None,
) -> PlainFits:
    """Fit the runs and keep those that are proven plain.

    Args:
        x: readings at equal intervals [m], shape (runs, samples).
        dt: the interval [s].
        machine: the `COEFFICIENTS` of the machine of each run, shape (runs,).
        free: names of the fitted ones.
        sigma: stated noise level of each run [m], shape (runs,); None if it is unknown.
        lateness: largest deviation of a time from the equal intervals [s], shape (runs,); None for zero.
        static: fixed static friction coefficient of each run, shape (runs,); None if it equals mu.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=5e3, duration=0.6, noise=1e-9, seed=0)
        >>> known = {"mass": 0.4, "stiffness": 2500.0, "damping": 0.2, "normal_force": 10.0, "mu": 0.06}
        >>> coefficients = {name: np.array([value]) for name, value in known.items()}
        >>> fits = fit_plain(np.asarray(run.x)[None], 2e-4, coefficients, ["mu", "damping", "stiffness"])
        >>> fits.values[0, :3].round(4).tolist()
        [0.05, 0.2, 2500.0]
    """
    # A run that is not plain may lead anywhere; its numbers are not used.
    with np.errstate(all="ignore"):
        runs, rough = rough_decays(x, dt)
        block = _Block(runs, {name: each[runs] for name, each in machine.items()}, tuple(free), rough.stop)
        values = block.start(rough)
        shortest = np.pi / np.sqrt(np.max(rough.omega2, initial=1e-300))
        stride = int(np.clip(shortest / dt / _FEW, 1, _STRIDE))
        for _ in range(_STEPS if runs.size else 0):
            values = values + block.solve(x[runs, ::stride], dt * stride, values).step
        block, values = block.only(block.allowed(values)), values[block.allowed(values)]
        runs = block.runs
        if not runs.size:
            p = values.shape[1]
            none = np.zeros((0, p, p))
            return PlainFits(runs, values, none, none, values, runs, runs, x[runs], None, {})
        values = values + block.solve(x[runs], dt, values).step
        solved = block.solve(x[runs], dt, values)
        sigma, lateness, static = (None if each is None else each[runs] for each in (sigma, lateness, static))
        failed, noise, residuals = refusals(x[runs], dt, solved.at, sigma, lateness)
        errors = noise[:, None] * solved.errors
        failed |= unfinished(solved.at, solved.step, errors, *block.static_band(solved, values, static, noise))
        failed["bounds"] = ~block.allowed(values - limit() * errors)
        remaining = np.sqrt(np.sum(solved.step * solved.gradient, axis=1)) / noise
    fits = PlainFits(
        runs, values, solved.inverse, solved.normal, solved.gradient, remaining, noise, residuals, solved.at,
        {name: runs[where] for name, where in failed.items()},
    )  # fmt: skip
    return fits.only(~np.any(list(failed.values()), axis=0))


class _Solved(NamedTuple):
    """Gauss-Newton step of each run, with the matrices of its least squares."""

    at: Evaluation
    jacobian: np.ndarray
    normal: np.ndarray
    gradient: np.ndarray
    inverse: np.ndarray
    step: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """Standard errors for unit noise."""
        return np.sqrt(np.diagonal(self.inverse, axis1=1, axis2=2))


class _Block(NamedTuple):
    """Runs with the coefficients of their machines.

    Attributes:
        runs: their indices.
        machine: coefficients of the machine of each run.
        free: names of the fitted ones.
        stop: number of half-cycles until the mass stops.
    """

    runs: np.ndarray
    machine: Mapping[str, np.ndarray]
    free: tuple[str, ...]
    stop: np.ndarray

    def only(self, which: np.ndarray) -> "_Block":
        machine = {name: values[which] for name, values in self.machine.items()}
        return _Block(self.runs[which], machine, self.free, self.stop[which])

    def start(self, rough: FreeDecay) -> np.ndarray:
        """Return the values at which the machine has the rough decay."""
        m = dict(self.machine)
        if "mass" in self.free:
            m["mass"] = m["stiffness"] / rough.omega2
        elif "stiffness" in self.free:
            m["stiffness"] = m["mass"] * rough.omega2
        friction = rough.dead_band * m["stiffness"]
        starts = {
            **m,
            "damping": 2 * m["mass"] * rough.decay_rate,
            "mu": friction / m["normal_force"],
            "normal_force": friction / m["mu"],
        }
        return np.stack([*(starts[name] for name in self.free), rough.t0, rough.x0, rough.offset], axis=1)

    def at(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Return all coefficients of the machines at these values."""
        return {**self.machine, **dict(zip(self.free, values.T, strict=False))}

    def allowed(self, values: np.ndarray) -> np.ndarray:
        """Return True for runs with finite values and positive coefficients that oscillate."""
        m = self.at(values)
        positive = np.all([m[name] > 0 for name in self.free], axis=0)
        oscillates = m["stiffness"] * m["mass"] > m["damping"] ** 2 / 4
        return positive & oscillates & np.all(np.isfinite(values), axis=1)

    def solve(self, x: np.ndarray, dt: float, values: np.ndarray) -> _Solved:
        """Linearise least squares about these values."""
        m = self.at(values)
        mass, stiffness, friction = m["mass"], m["stiffness"], m["normal_force"] * m["mu"]
        omega2, rate, band = stiffness / mass, m["damping"] / (2 * mass), friction / stiffness
        decay = FreeDecay._make([*values[:, -3:].T, omega2, rate, band, self.stop])
        slopes = {
            "mass": (-omega2 / mass, -rate / mass, 0.0),
            "stiffness": (1 / mass, 0.0, -band / stiffness),
            "damping": (0.0, 1 / (2 * mass), 0.0),
            "normal_force": (0.0, 0.0, m["mu"] / stiffness),
            "mu": (0.0, 0.0, m["normal_force"] / stiffness),
        }
        p = len(self.free)
        jacobian = np.zeros((len(values), 6, p + 3))
        jacobian[:, np.arange(3), np.arange(p, p + 3)] = 1.0
        for place, name in enumerate(self.free):
            for row, slope in enumerate(slopes[name]):
                jacobian[:, 3 + row, place] = slope
        at = evaluate(x, dt, decay, np.ceil(decay.t0 / dt).astype(int))
        turned = jacobian.transpose(0, 2, 1)
        normal = turned @ at.normal @ jacobian
        scale = 1 / np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
        scales = scale[:, :, None] * scale[:, None, :]
        # The smallest number that keeps a singular matrix from stopping the other runs.
        inverse = scales * np.linalg.inv(scales * normal + 1e-15 * np.identity(p + 3))
        gradient = (turned @ at.gradient[..., None])[..., 0]
        return _Solved(at, jacobian, normal, gradient, inverse, (inverse @ gradient[..., None])[..., 0])

    def static_band(
        self, solved: _Solved, values: np.ndarray, static: np.ndarray | None, noise: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the static dead band of each run [m].

        The second array is the standard error of the distance of the last turning point to it [m].
        """
        at, m, rows = solved.at, self.at(values), np.arange(len(values))
        value, *slopes = (each[rows, at.half_cycles] for each in at.amplitudes)
        by_x0, by_omega2, by_rate, by_band = slopes
        # A fixed static coefficient has no error.
        by_band = by_band - (static is None)
        zero = np.zeros_like(value)
        slope = np.stack([zero, by_x0, zero, by_omega2, by_rate, by_band], axis=1)[:, None] @ solved.jacobian
        error = noise * np.sqrt((slope @ solved.inverse @ slope.transpose(0, 2, 1))[:, 0, 0])
        coefficient = m["mu"] if static is None else np.maximum(static, m["mu"])
        return coefficient * m["normal_force"] / m["stiffness"], error
