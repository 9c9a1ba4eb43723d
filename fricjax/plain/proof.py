"""Proof by residuals that a record is plain.

A record is plain if its residuals are white and of constant variance in every way that we test, and if the law stops
the mass where the record does. Each test refuses a plain record with the probability `CHANCE`. A refused record is not
wrong: it only needs a closer look, by the general way of fitting.
"""

from statistics import NormalDist

import numpy as np

from .decay import NEVER, Evaluation

CHANCE = 1e-4
"""Probability that a test refuses a plain record (`experiments/plain/run.py`)."""

# Number of phase bins and of rows of a half-cycle, and number of lags that are tested.
_BINS, _ROWS, _LAGS = 10, 40, 40
# Largest part of equal neighbours. Rounding to a step of twice the noise makes 20 %.
_REPEATED = 2e-3
# Largest distance from the optimum, in standard errors.
_ARRIVED = 0.05
# Largest variance that errors of the times may add, relative to that of the noise.
_TIMING = 0.01


def limit(chance: float | None = None) -> float:
    """Return the value that a normal number exceeds by chance."""
    return NormalDist().inv_cdf(1 - (CHANCE if chance is None else chance))


def chi2_limit(dof: np.ndarray | float) -> np.ndarray | float:
    """Return the value that chi^2 exceeds with the probability `CHANCE`.

    Source: Wilson and Hilferty 1931, PNAS 17.
    """
    scale = 2 / (9 * np.asarray(dof, dtype=float))
    return dof * (1 - scale + limit() * np.sqrt(scale)) ** 3


def refusals(
    x: np.ndarray, dt: float, at: Evaluation, sigma: np.ndarray | None, lateness: np.ndarray | None
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Test the residuals of each run.

    Args:
        x: readings at equal intervals [m], shape (runs, samples).
        dt: the interval [s].
        at: the decays at the optimum.
        sigma: stated noise level of each run [m], shape (runs,); None if it is unknown.
        lateness: largest deviation of a time from the equal intervals [s], shape (runs,); None for zero.

    Returns:
        For each test the runs that fail it, shape (runs,); the noise level of each run from its residuals [m]; and the
        residuals of all samples [m], shape (runs, samples).
    """
    r = at.of_samples(x)
    n, first = x.shape[1], at.begins[:, 0]
    used = n - first
    chi2 = np.einsum("rn,rn->r", r, r)
    noise = np.sqrt(chi2 / (used - at.gradient.shape[1]))
    two_sided = limit(CHANCE / 2)
    failed = {}
    if sigma is not None:
        failed["size"] = np.abs(noise**2 / sigma**2 - 1) > two_sided * np.sqrt(2 / used)
    lags = [np.einsum("rn,rn->r", r[:, lag:], r[:, :-lag]) / chi2 for lag in (1, 2)]
    failed["neighbours"] = np.max(np.abs(lags), axis=0) > limit(CHANCE / 4) / np.sqrt(used)
    failed["outliers"] = np.max(np.abs(r), axis=1) > limit(CHANCE / (2 * n)) * noise
    failed["repeated samples"] = np.mean(x[:, 1:] == x[:, :-1], axis=1) > _REPEATED
    speed = np.abs(at.decay.x0) * np.sqrt(at.decay.omega2)
    failed["times"] = (0.0 if lateness is None else lateness) * speed > np.sqrt(_TIMING) * noise
    failed |= _spectrum(r, dt, at, noise, used)
    failed |= _variance(r, at, noise)
    failed |= _forces(at, noise)
    return failed, noise, r


def _spectrum(r: np.ndarray, dt: float, at: Evaluation, noise: np.ndarray, used: np.ndarray) -> dict[str, np.ndarray]:
    """Test means of some samples for memory, lines and slow motion."""
    size = max(1, round(float(np.median(np.pi / at.decay.omega)) / dt / _ROWS))
    rows = r.shape[1] // size
    means = r[:, : rows * size].reshape(len(r), rows, size).sum(axis=2) / (noise[:, None] * np.sqrt(size))
    length = 1 << int(rows - 1).bit_length()
    power = np.abs(np.fft.rfft(means, 2 * length, axis=1)) ** 2
    count = (used / size)[:, None]
    memory = np.fft.irfft(power, axis=1)[:, 1 : _LAGS + 1] / np.sqrt(count)
    # Frequencies at which white noise has independent powers.
    lines = (power[:, ::2] / count)[:, 1:]
    few = _LAGS // 2
    return {
        "memory at one lag": np.max(np.abs(memory), axis=1) > limit(CHANCE / (2 * _LAGS)),
        "memory at all lags": np.sum(memory[:, :few] ** 2, axis=1) > chi2_limit(few),
        "lines": np.max(lines, axis=1) > np.log(length / CHANCE),
        # Powers are exponential, so twice their sum is chi^2 with two degrees each.
        "slow motion": 2 * np.sum(lines[:, :5], axis=1) > chi2_limit(10),
    }


def _variance(r: np.ndarray, at: Evaluation, noise: np.ndarray) -> dict[str, np.ndarray]:
    """Test the variance: in motion against the rest, in time, with speed."""
    squares, n = (r / noise[:, None]) ** 2, r.shape[1]
    first, rest, two_sided = at.begins[:, 0], at.rest, limit(CHANCE / 2)
    sums = np.concatenate([np.zeros((len(r), 1)), np.cumsum(squares, axis=1)], axis=1)
    rows = np.arange(len(r))
    moving, resting = rest - first, n - rest
    levels = sums[rows, rest] / moving, (sums[:, -1] - sums[rows, rest]) / np.maximum(resting, 1)
    scatter = np.sqrt(2 / moving + 2 / np.maximum(resting, 1))
    failed = {"rest": (resting > 8) & (np.abs(levels[0] - levels[1]) > two_sided * scatter)}
    middle = (first + n) // 2
    early = sums[rows, middle] / (middle - first)
    late = (sums[:, -1] - sums[rows, middle]) / (n - middle)
    failed["time"] = np.abs(early - late) > two_sided * np.sqrt(2 / (middle - first) + 2 / (n - middle))
    places = np.arange(at.residual.shape[2])
    valid = places < at.counts[:, :, None]
    swing = np.maximum(at.amplitudes.value[:, :-1] - at.decay.dead_band[:, None], 0)
    speed2 = (swing[:, :, None] * np.sin(np.pi * places / places.size)) ** 2 * valid
    deviation = (speed2 - (speed2.sum(axis=(1, 2)) / moving)[:, None, None]) * valid
    score = np.sum(deviation * at.residual**2, axis=(1, 2)) / noise**2
    failed["speed"] = np.abs(score) > two_sided * np.sqrt(2 * np.sum(deviation**2, axis=(1, 2)))
    return failed


def _forces(at: Evaluation, noise: np.ndarray) -> dict[str, np.ndarray]:
    """Test for missing forces: by phase, by amplitude and by half-cycle.

    A force that changes its sign with the direction adds up in the frame of the side, others in that of the reading.
    """
    size = at.residual.shape[2] // _BINS
    shape = (*at.residual.shape[:2], _BINS, size)
    bins = at.residual[:, :, : _BINS * size].reshape(shape).sum(axis=3) / (np.sqrt(size) * noise[:, None, None])
    count = at.half_cycles[:, None]
    swing = np.maximum(at.amplitudes.value[:, :-1], 0) * (at.counts > 0)
    swing = swing / np.linalg.norm(swing, axis=1, keepdims=True)
    sums = {
        "phase": bins.sum(axis=1) / np.sqrt(count),
        "phase of the reading": np.sum(bins * at.side[:, :, None], axis=1) / np.sqrt(count),
        "amplitude": np.einsum("rhb,rh->rb", bins, swing),
    }
    failed = {name: np.sum(each**2, axis=1) > chi2_limit(_BINS) for name, each in sums.items()}
    cycles = bins.sum(axis=2) / np.sqrt(_BINS)
    return failed | {"half-cycles": np.sum(cycles**2, axis=1) > chi2_limit(at.half_cycles)}


def unfinished(
    at: Evaluation, step: np.ndarray, errors: np.ndarray, static_band: np.ndarray, band_error: np.ndarray
) -> dict[str, np.ndarray]:
    """Test whether the fit has arrived, and the place of the stop.

    Args:
        at: the decays at the optimum.
        step: the remaining step of each coefficient, shape (runs, coefficients).
        errors: standard errors of the coefficients, same shape.
        static_band: static friction over stiffness [m], shape (runs,).
        band_error: standard error of its difference to a turning point [m], shape (runs,).
    """
    rows, count = np.arange(len(step)), at.half_cycles
    last, before = at.amplitudes.value[rows, count], at.amplitudes.value[rows, count - 1]
    margin = limit(CHANCE / 2) * band_error
    stops = at.decay.stop < NEVER
    # Without a stop the last reversal may lie behind the record.
    starts = before < static_band + margin
    stays = np.abs(last) > static_band - margin
    return {
        "optimum": ~(np.max(np.abs(step) / errors, axis=1) < _ARRIVED),
        "stop": starts | np.where(stops, stays, last < static_band + margin),
    }
