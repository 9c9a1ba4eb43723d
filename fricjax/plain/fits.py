"""Fit plain records of a linear oscillator with Coulomb friction.

Gauss-Newton steps on few samples lead from the rough decay close to the optimum, and two steps on all samples to it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from .decay import NEVER, Evaluation, FreeDecay, evaluate
from .proof import limit, refusals, unfinished
from .start import rough_decays

RUN_COEFFICIENTS = ("t_release", "x0", "offset")
"""Coefficients of each run. The first one is fixed if the release is known; the others are always free."""

COEFFICIENTS = ("mass", "stiffness", "damping", "normal_force", "mu")
"""Coefficients of the machine that can be free."""

# Gauss-Newton steps on few samples. From a rough decay the error decreases to 1e-3 and 1e-6; one more is for safety.
_STEPS = 3
# Steps on all samples. The first one is some standard errors long, and the second one a part in a thousand of it.
_LAST_STEPS = 2
ITERATIONS = _STEPS + _LAST_STEPS
"""Gauss-Newton steps of a fit."""

# Largest number of times that the number of half-cycles changes by one.
_COUNTS = 3
# Samples of a half-cycle for these steps.
_FEW = 12
_STRIDE = 8


class PlainFits(NamedTuple):
    """Fits of the runs that were proven plain.

    Attributes:
        runs: indices of these runs.
        values: fitted coefficients, shape (runs, p): those of the machine in the order of the names, then those of the
            run: time of the first reversal from the first sample [s] unless the release is known, deflection there [m]
            and offset [m].
        start: rough values, same shape.
        inverse: inverse of J'J for `values`, without the noise, shape (runs, p, p).
        normal: J'J, same shape.
        gradient: J'r, shape (runs, p).
        remaining: length of the remaining step in standard errors, shape (runs,).
        noise: noise level from the residuals [m], shape (runs,).
        residuals: reading minus model of all samples [m], zero before the first reversal, shape (runs, samples).
        at: the decays.
        refused: for each test the indices of runs that fail it.

    Examples:
        >>> PlainFits._fields[:4]
        ('runs', 'values', 'start', 'inverse')
    """

    runs: np.ndarray
    values: np.ndarray
    start: np.ndarray
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
    release: np.ndarray | None = None,
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
        release: time of the release from rest, from the first sample [s], shape (runs,). The fit then starts there, and
            for None at the first reversal, at a time that is fitted.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=5e3, duration=0.6, noise=1e-9, seed=0)
        >>> known = {"mass": 0.4, "stiffness": 2500.0, "damping": 0.2, "normal_force": 10.0, "mu": 0.06}
        >>> coefficients = {name: np.array([value]) for name, value in known.items()}
        >>> fits = fit_plain(np.asarray(run.x)[None], 2e-4, coefficients, ["mu", "damping", "stiffness"])
        >>> fits.values[0, :3].round(3).tolist()
        [0.05, 0.2, 2500.0]
    """
    # A run that is not plain may lead anywhere; its numbers are not used.
    with np.errstate(all="ignore"):
        runs, rough = rough_decays(x, dt)
        known = {name: each[runs] for name, each in machine.items()}
        if release is not None:
            known["t_release"], rough = release[runs], rough.from_release(release[runs])
        names = (*free, *(name for name in RUN_COEFFICIENTS if name not in known))
        block = _Block.of(runs, known, names, rough)
        block = block.only(block.allowed)
        stride = int(np.clip(np.min(block.period, initial=np.inf) / dt / _FEW, 1, _STRIDE))
        few = x[:, ::stride]
        for _ in range(_COUNTS):
            for _ in range(_STEPS):
                block = block.stepped(few, dt * stride)
            block, changed = block.with_best_stop(few, dt * stride)
            if not changed.any():
                break
        block = block.only(block.second_best > 0)
        for _ in range(_LAST_STEPS):
            block = block.stepped(x, dt)
        if not block.runs.size:
            runs, none, matrices = block.runs, block.values, np.zeros((0, *2 * block.values.shape[1:]))
            return PlainFits(runs, none, none, matrices, matrices, none, runs, runs, none, None, {})
        runs, values, solved = block.runs, block.values, block.solve(x, dt)
        sigma, lateness, static = (None if each is None else each[runs] for each in (sigma, lateness, static))
        failed, noise, residuals = refusals(x[runs], dt, solved.at, sigma, lateness)
        errors = noise[:, None] * solved.errors
        failed |= unfinished(solved.at, solved.step, errors, *block.static_band(solved, static, noise))
        failed["number of half-cycles"] = ~(block.second_best > thresholds.DECISIVE * noise**2)
        failed["bounds"] = ~block._replace(values=values - limit() * errors).allowed
        remaining = np.sqrt(np.sum(solved.step * solved.gradient, axis=1)) / noise
    fits = PlainFits(
        runs, values, block.start, solved.inverse, solved.normal, solved.gradient, remaining, noise, residuals,
        solved.at, {name: runs[where] for name, where in failed.items()},
    )  # fmt: skip
    return fits.only(~np.any(list(failed.values()), axis=0))


def decay_slopes(m: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the derivatives of a `FreeDecay` by each coefficient.

    Args:
        m: coefficients of machine and run, each of shape (runs,).

    Returns:
        Arrays of shape (runs, 6), by name of the coefficient.

    Examples:
        >>> machine = dict.fromkeys(("mass", "stiffness", "damping", "normal_force", "mu"), np.ones(1))
        >>> decay_slopes(machine)["stiffness"].tolist()
        [[0.0, 0.0, 0.0, 1.0, 0.0, -1.0]]
    """
    mass, stiffness, load = m["mass"], m["stiffness"], m["normal_force"]
    omega2, rate, band = stiffness / mass, m["damping"] / (2 * mass), m["mu"] * load / stiffness
    one, zero = np.ones_like(mass), np.zeros_like(mass)
    # The last three columns are omega2, decay_rate and dead_band.
    by_machine = {
        "mass": (-omega2 / mass, -rate / mass, zero),
        "stiffness": (1 / mass, zero, -band / stiffness),
        "damping": (zero, 1 / (2 * mass), zero),
        "normal_force": (zero, zero, m["mu"] / stiffness),
        "mu": (zero, zero, load / stiffness),
    }
    slopes = {name: np.stack([zero, zero, zero, *each], axis=-1) for name, each in by_machine.items()}
    for place, name in enumerate(RUN_COEFFICIENTS):
        slopes[name] = np.stack([one if column == place else zero for column in range(6)], axis=-1)
    return slopes


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
    """Runs on the way to their optimum.

    Attributes:
        runs: indices of the runs.
        known: coefficients of machine and run, unless they are fitted.
        free: names of the fitted ones.
        period: rough duration of a half-cycle [s].
        stop: number of half-cycles until the mass stops.
        values: values of the fitted coefficients, shape (runs, p).
        start: those of the rough decay.
        second_best: rise of the sum of squares with the next best number of half-cycles [m^2]; inf without a stop.
    """

    runs: np.ndarray
    known: Mapping[str, np.ndarray]
    free: tuple[str, ...]
    period: np.ndarray
    stop: np.ndarray
    values: np.ndarray
    start: np.ndarray
    second_best: np.ndarray

    @classmethod
    def of(cls, runs: np.ndarray, known: Mapping[str, np.ndarray], free: tuple[str, ...], rough: FreeDecay) -> "_Block":
        """Return the runs with the values of the rough decay."""
        m = dict(known)
        if "mass" in free:
            m["mass"] = m["stiffness"] / rough.omega2
        elif "stiffness" in free:
            m["stiffness"] = m["mass"] * rough.omega2
        friction = rough.dead_band * m["stiffness"]
        starts = {
            **m,
            "damping": 2 * m["mass"] * rough.decay_rate,
            "mu": friction / m["normal_force"],
            "normal_force": friction / m["mu"],
            "t_release": rough.t0,
            "x0": rough.x0,
            "offset": rough.offset,
        }
        values = np.stack([starts[name] for name in free], axis=1)
        return cls(runs, known, free, np.pi / rough.omega, rough.stop, values, values, np.zeros(runs.size))

    def only(self, which: np.ndarray) -> "_Block":
        """Return some of the runs."""
        few = {name: each[which] for name, each in self._asdict().items() if isinstance(each, np.ndarray)}
        return self._replace(**few, known={name: values[which] for name, values in self.known.items()})

    @property
    def coefficients(self) -> dict[str, np.ndarray]:
        """All coefficients of machine and run."""
        return {**self.known, **dict(zip(self.free, self.values.T, strict=True))}

    @property
    def decay(self) -> FreeDecay:
        m = self.coefficients
        return FreeDecay(
            t0=m["t_release"],
            x0=m["x0"],
            offset=m["offset"],
            omega2=m["stiffness"] / m["mass"],
            decay_rate=m["damping"] / (2 * m["mass"]),
            dead_band=m["mu"] * m["normal_force"] / m["stiffness"],
            stop=self.stop,
        )

    @property
    def allowed(self) -> np.ndarray:
        """True for positive coefficients near the rough decay."""
        decay = self.decay
        ratio = np.pi / decay.omega / self.period
        near = (ratio > 0.5) & (ratio < 2) & (decay.t0 >= 0) & np.isfinite(decay.x0)
        positive = [self.coefficients[name] > 0 for name in self.free if name in COEFFICIENTS]
        return near & np.all(positive, axis=0)

    def stepped(self, x: np.ndarray, dt: float) -> "_Block":
        """Return the runs after a step, without those it leads astray.

        Args:
            x: readings of all runs [m].
            dt: their interval [s].
        """
        moved = self._replace(values=self.values + self.solve(x, dt).step)
        return moved.only(moved.allowed)

    def with_best_stop(self, x: np.ndarray, dt: float) -> tuple["_Block", np.ndarray]:
        """Return runs with the best number of half-cycles, and where it changes.

        One more and one less are evaluated as well; their sums of squares are predicted after a Gauss-Newton step.
        Arguments as for `stepped`.
        """
        stopping = self.stop < NEVER
        stop, rise = self.stop.copy(), np.full(self.runs.size, np.inf)
        if not stopping.any():
            return self._replace(second_best=rise), stopping
        some, stops, squares = self.only(stopping), [], []
        for change in (-1, 0, 1):
            rival = some._replace(stop=np.maximum(some.stop + change, 1))
            solved = rival.solve(x, dt)
            left = np.sum(solved.at.of_samples(x[some.runs]) ** 2, axis=1)
            left = left - np.sum(solved.step * solved.gradient, axis=1)
            stops.append(rival.stop)
            squares.append(np.where(np.isfinite(left), left, np.inf))
        least, second = np.sort(squares, axis=0)[:2]
        stop[stopping], rise[stopping] = np.choose(np.argmin(squares, axis=0), stops), second - least
        changed = stop != self.stop
        return self._replace(stop=stop, second_best=np.where(changed, 0.0, rise)), changed

    def solve(self, x: np.ndarray, dt: float) -> _Solved:
        """Linearise least squares; arguments as for `stepped`."""
        decay, slopes = self.decay, decay_slopes(self.coefficients)
        jacobian = np.stack([slopes[name] for name in self.free], axis=2)
        at = evaluate(x[self.runs], dt, decay, np.ceil(decay.t0 / dt).astype(int))
        transposed = jacobian.transpose(0, 2, 1)
        normal = transposed @ at.normal @ jacobian
        scale = 1 / np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
        scales = scale[:, :, None] * scale[:, None, :]
        # The smallest number that keeps a singular matrix from stopping the other runs.
        inverse = scales * np.linalg.inv(scales * normal + 1e-15 * np.identity(len(self.free)))
        gradient = (transposed @ at.gradient[..., None])[..., 0]
        return _Solved(at, jacobian, normal, gradient, inverse, (inverse @ gradient[..., None])[..., 0])

    def static_band(
        self, solved: _Solved, static: np.ndarray | None, noise: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the static dead band of each run [m].

        The second array is the standard error of the distance of the last turning point to it [m].
        """
        at, m, rows = solved.at, self.coefficients, np.arange(self.runs.size)
        value, *slopes = (each[rows, at.half_cycles] for each in at.amplitudes)
        by_x0, by_omega2, by_rate, by_band = slopes
        # A fixed static coefficient has no error.
        by_band = by_band - (static is None)
        zero = np.zeros_like(value)
        slope = np.stack([zero, by_x0, zero, by_omega2, by_rate, by_band], axis=1)[:, None] @ solved.jacobian
        error = noise * np.sqrt((slope @ solved.inverse @ slope.transpose(0, 2, 1))[:, 0, 0])
        coefficient = m["mu"] if static is None else np.maximum(static, m["mu"])
        return coefficient * m["normal_force"] / m["stiffness"], error
