"""Closed form of decays with Coulomb friction and viscous damping.

Half-cycle ``n`` begins at the time ``t_0 + n T`` with the deflection ``a_n`` from the equilibrium on the side ``s_n``.
With the dead band ``d``, the decay rate ``z``, ``omega^2 = w - z^2`` and ``T = pi/omega``, the reading is

    x = offset + s_n [d + (a_n - d) exp(-z tau) (cos omega tau + z/omega sin omega tau)],
    a_{n+1} = rho a_n - (1 + rho) d,    rho = exp(-z T),    s_{n+1} = -s_n,

where ``tau`` is the time since the reversal (Lorenz 1924; Markho 1980, J. Dyn. Sys. Meas. Control 102). Every
derivative in a half-cycle is a combination of 1, C, S, t C and t S with ``C = exp(-z t) cos omega t`` and ``S``
likewise. So the samples are multiplied by these five functions once, and the normal equations follow from small
matrices.
"""

from typing import Any, NamedTuple

import numpy as np

NEVER = 10**9
"""Number of half-cycles of a decay that does not stop."""


class FreeDecay(NamedTuple):
    """Coefficients of the decay of each run, shape (runs,).

    Attributes:
        t0: time of the first reversal, from the first sample [s].
        x0: deflection from the equilibrium there [m].
        offset: reading at the equilibrium [m].
        omega2: stiffness over mass [1/s^2].
        decay_rate: damping over twice the mass [1/s].
        dead_band: friction over stiffness [m].
        stop: number of half-cycles until the mass stops; `NEVER` if it does not.

    Examples:
        >>> FreeDecay(0.0, 1e-3, 0.0, 100.0, 0.0, 1e-5, NEVER).omega
        np.float64(10.0)
    """

    t0: Any
    x0: Any
    offset: Any
    omega2: Any
    decay_rate: Any
    dead_band: Any
    stop: Any

    @property
    def omega(self) -> np.ndarray:
        """Damped angular frequency [rad/s], shape (runs,)."""
        return np.sqrt(self.omega2 - self.decay_rate**2)

    def from_release(self, release: np.ndarray) -> "FreeDecay":
        """Return the decays from the releases, one half-cycle before the first reversals.

        The time is NaN if the release is not near that place.
        """
        period, rho = np.pi / self.omega, np.exp(-self.decay_rate * np.pi / self.omega)
        swing = (np.abs(self.x0) + (1 + rho) * self.dead_band) / rho
        near = np.abs(self.t0 - period - release) < period / 8
        stop = np.where(self.stop < NEVER, self.stop + 1, NEVER)
        return self._replace(t0=np.where(near, release, np.nan), x0=-np.sign(self.x0) * swing, stop=stop)

    def of(self, which: Any) -> "FreeDecay":
        """Return the decays of some runs, or of one."""
        return FreeDecay._make(each[which] for each in self)


class Amplitudes(NamedTuple):
    """Deflections at the reversals and their derivatives.

    Arrays have the shape (runs, half_cycles + 1).
    """

    value: np.ndarray
    by_x0: np.ndarray
    by_omega2: np.ndarray
    by_decay_rate: np.ndarray
    by_dead_band: np.ndarray


class Evaluation(NamedTuple):
    """Residuals of some decays with their normal equations.

    Attributes:
        decay: the decays.
        residual: reading minus model of each half-cycle, times its side [m], shape (runs, half_cycles, samples); zero
            for padding.
        begins: index of the first sample of each half-cycle and of the rest, shape (runs, half_cycles + 1).
        half_cycles: number of half-cycles, shape (runs,).
        side: side of each half-cycle, shape (runs, half_cycles).
        amplitudes: deflections at the reversals [m].
        normal, gradient: J'J and J'r for the coefficients, shapes (runs, 6, 6) and (runs, 6).
    """

    decay: FreeDecay
    residual: np.ndarray
    begins: np.ndarray
    half_cycles: np.ndarray
    side: np.ndarray
    amplitudes: Amplitudes
    normal: np.ndarray
    gradient: np.ndarray

    def only(self, which: Any) -> "Evaluation":
        """Return the evaluations of some runs."""
        few = {name: each[which] for name, each in self._asdict().items() if isinstance(each, np.ndarray)}
        amplitudes = Amplitudes(*(each[which] for each in self.amplitudes))
        return self._replace(**few, decay=self.decay.of(which), amplitudes=amplitudes)

    @property
    def counts(self) -> np.ndarray:
        """Number of samples of each half-cycle, shape (runs, half_cycles)."""
        return np.diff(self.begins, axis=1)

    @property
    def rest(self) -> np.ndarray:
        """Index of the first sample of the rest, shape (runs,)."""
        return self.begins[np.arange(len(self.begins)), self.half_cycles]

    def of_samples(self, x: np.ndarray) -> np.ndarray:
        """Return the residuals of all samples [m], zero before the first reversal.

        Args:
            x: the readings [m], shape (runs, samples).
        """
        n_runs, n = x.shape
        residual, places = np.zeros((n_runs, n + 1)), np.arange(self.residual.shape[2])
        index = np.where(places < self.counts[:, :, None], self.begins[:, :-1, None] + places, n)
        signed = self.residual * self.side[:, :, None]
        size = n_runs, index.shape[1] * index.shape[2]
        np.put_along_axis(residual, index.reshape(size), signed.reshape(size), axis=1)
        for run in np.flatnonzero(self.decay.stop < NEVER):
            count = self.half_cycles[run]
            end = self.side_after[run] * self.amplitudes.value[run, count] + self.decay.offset[run]
            residual[run, self.rest[run] : n] = x[run, self.rest[run] :] - end
        return residual[:, :n]

    @property
    def sides(self) -> np.ndarray:
        """Side of each reversal, shape (runs, half_cycles + 1)."""
        return np.sign(self.decay.x0)[:, None] * (-1.0) ** np.arange(self.begins.shape[1])

    @property
    def side_after(self) -> np.ndarray:
        """Side of the end of the last half-cycle, shape (runs,)."""
        return np.sign(self.decay.x0) * (-1.0) ** self.half_cycles


def amplitudes_of(decay: FreeDecay, half_cycles: int) -> Amplitudes:
    """Return the deflections at the reversals and their derivatives."""
    omega, z, side = decay.omega, decay.decay_rate, np.sign(decay.x0)
    period, rho = np.pi / omega, np.exp(-z * np.pi / omega)
    by_z, by_omega2 = -rho * (period + z * np.pi * z / omega**3), rho * z * np.pi / (2 * omega**3)
    order = np.arange(half_cycles + 1)
    powers = rho[:, None] ** order
    # Sums of the powers before each reversal, and their derivatives by rho.
    sums = _sums_before(powers)
    slopes = order * powers / rho[:, None]
    sum_slopes = _sums_before(slopes)
    band, start = decay.dead_band[:, None], np.abs(decay.x0)[:, None]
    by_band = -(1 + rho)[:, None] * sums
    by_rho = slopes * start - band * sums - (1 + rho)[:, None] * band * sum_slopes
    return Amplitudes(
        powers * start + by_band * band,
        powers * side[:, None],
        by_rho * by_omega2[:, None],
        by_rho * by_z[:, None],
        by_band,
    )


def _sums_before(values: np.ndarray) -> np.ndarray:
    return np.cumsum(values, axis=1) - values


def evaluate(x: np.ndarray, dt: float, decay: FreeDecay, first: np.ndarray) -> Evaluation:
    """Return residuals and normal equations of the decays.

    Args:
        x: readings at equal intervals [m], shape (runs, samples).
        dt: the interval [s].
        decay: the decays.
        first: index of the first sample that is fitted, shape (runs,).
    """
    n_runs, n = x.shape
    omega, z, rows = decay.omega, decay.decay_rate, np.arange(n_runs)
    period = np.pi / omega
    count = np.minimum(decay.stop, np.floor((n * dt - decay.t0) / period) + 1).astype(int)
    order = np.arange(int(count.max(initial=1)) + 1)
    amplitudes = amplitudes_of(decay, order[-1])
    begins = np.ceil((decay.t0[:, None] + order * period[:, None]) / dt - 1e-9).astype(int)
    begins[:, 0] = first
    begins = np.minimum(np.where(order <= count[:, None], begins, begins[rows, count][:, None]), n)
    counts, side = np.diff(begins, axis=1), np.sign(decay.x0)[:, None] * (-1.0) ** order[:-1]
    places = np.arange(int(counts.max(initial=1)))
    basis = _basis(places * dt, omega, z)
    late = begins[:, :-1] * dt - decay.t0[:, None] - order[:-1] * period[:, None]
    model, columns = _combinations(decay, amplitudes, side, late)
    index = np.minimum(begins[:, :-1, None] + places, n - 1) + (rows * n)[:, None, None]
    residual = x.ravel()[index]
    residual -= decay.offset[:, None, None]
    residual *= side[:, :, None]
    residual -= model @ basis.transpose(0, 2, 1)
    residual *= places < counts[:, :, None]
    # Products of the functions, summed over the samples of a half-cycle.
    products = np.zeros((n_runs, places.size + 1, 5, 5))
    np.cumsum(basis[:, :, :, None] * basis[:, :, None, :], axis=1, out=products[:, 1:])
    weighted = columns @ products[rows[:, None], counts]
    normal = _by_column(weighted) @ _by_column(columns).transpose(0, 2, 1)
    gradient = (columns @ (residual @ basis)[..., None])[..., 0].sum(axis=1)
    evaluation = Evaluation(decay, residual, begins, count, side, amplitudes, normal, gradient)
    _add_rest(x, evaluation)
    return evaluation


def _by_column(values: np.ndarray) -> np.ndarray:
    """Return an array of shape (runs, columns, half_cycles * functions)."""
    runs, half_cycles, columns, functions = values.shape
    return values.transpose(0, 2, 1, 3).reshape(runs, columns, half_cycles * functions)


def _basis(t: np.ndarray, omega: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the five functions, shape (runs, times, 5)."""
    decay = np.exp(-z[:, None] * t)
    cosine, sine = decay * np.cos(omega[:, None] * t), decay * np.sin(omega[:, None] * t)
    return np.stack([np.ones_like(cosine), cosine, sine, t * cosine, t * sine], axis=2)


def _combinations(
    decay: FreeDecay, amplitudes: Amplitudes, side: np.ndarray, late: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return model and derivatives as combinations of the basis.

    The basis counts time from the first sample of a half-cycle, which is `late` after the reversal.

    Returns:
        Shapes (runs, half_cycles, 5) and (runs, half_cycles, 6, 5), both times the side.
    """
    omega, z, w, band = (each[:, None] for each in (decay.omega, decay.decay_rate, decay.omega2, decay.dead_band))
    order, zero = np.arange(side.shape[1]), np.zeros_like(side)
    fading = np.exp(-z * late)
    cosine, sine = fading * np.cos(omega * late), fading * np.sin(omega * late)

    def shifted(constant: Any, c: Any, s: Any, tc: Any = zero, ts: Any = zero) -> np.ndarray:
        c, s = c + tc * late, s + ts * late
        parts = (c * cosine + s * sine, s * cosine - c * sine, tc * cosine + ts * sine, ts * cosine - tc * sine)
        return np.stack([constant + zero, *parts], axis=2)

    swing, *slopes = (each[:, :-1] for each in amplitudes)
    swing = swing - band
    by_x0, by_w, by_z, by_band = slopes
    velocity = -swing * w / omega
    # Later reversals move with the half-period.
    period_by_w, period_by_z = -np.pi / (2 * omega**3), np.pi * z / omega**3
    columns = [
        shifted(zero, zero, -velocity),
        shifted(zero, by_x0, by_x0 * z / omega),
        shifted(side, zero, zero),
        shifted(
            zero,
            by_w,
            by_w * z / omega - swing * z / (2 * omega**3) - order * period_by_w * velocity,
            swing * z / (2 * omega**2),
            -swing / (2 * omega),
        ),
        shifted(
            zero,
            by_z,
            by_z * z / omega + swing * w / omega**3 - order * period_by_z * velocity,
            -swing * w / omega**2,
        ),
        shifted(1.0, by_band - 1, (by_band - 1) * z / omega),
    ]
    return shifted(band, swing, swing * z / omega), np.stack(columns, axis=2)


def _add_rest(x: np.ndarray, evaluation: Evaluation) -> None:
    """Add the samples of the rest to the normal equations."""
    decay, rows, n = evaluation.decay, np.arange(len(x)), x.shape[1]
    stops = np.flatnonzero(decay.stop < NEVER)
    begin, after = evaluation.rest, evaluation.side_after
    value, *slopes = (each[rows, evaluation.half_cycles] for each in evaluation.amplitudes)
    by_x0, by_w, by_z, by_band = slopes
    column = np.stack([np.zeros_like(value), by_x0, after, by_w, by_z, by_band], axis=1)
    for run in stops:
        samples = n - begin[run]
        left = after[run] * (x[run, begin[run] :].sum() - samples * decay.offset[run]) - samples * value[run]
        evaluation.normal[run] += samples * np.outer(column[run], column[run])
        evaluation.gradient[run] += left * column[run]
