"""Segmentation of a reading that is not the displacement itself.

Half-cycles, reversals and rest are those of the displacement. So an approximate displacement is derived from the
reading once. It serves for start values only; the fit uses the reading. A velocity is integrated after its bias and
drift are removed; an acceleration is integrated twice. Bias and drift are a straight line through the averages over one
period: in a decay the average velocity over a period is small and changes sign at each half-cycle. The position of a
filmed pendulum is converted to its angle.
"""

import dataclasses

import numpy as np

from ..observation import Observation
from .decay import Segmentation, segment
from .disturbance import disturbance
from .half_cycles import HalfCycles
from .noise import NORMAL_MAD, median, resolution, typical_interval, white_noise
from .swing import PreparedTrace, without_spikes

# Fewest turning points that show an equilibrium.
_FEWEST = 3
# Rounds that leave out averages far from the line, and this distance in median distances: three standard deviations.
_TRIMS, _FAR = 4, 3.0 / NORMAL_MAD


def segment_reading(
    observation: Observation, t: np.ndarray, y: np.ndarray, sigma: np.ndarray | None, mask: np.ndarray
) -> tuple[Segmentation, np.ndarray]:
    """Return the segmentation of a motion from its reading, and the displacement.

    Noise, resolution, hum and drift are those of the reading, over its gain.

    Args:
        observation: the map from the motion to the reading.
        t: times [s], shape (n,).
        y: reading, shape (n,).
        sigma: stated noise of the reading, one number or shape (n,); None if unknown.
        mask: True where a sample is used, shape (n,).

    Raises:
        DataError: the reading is constant, or there are too few samples, altogether or per half-cycle.
    """
    used = mask & np.isfinite(y)
    # Refusals must speak of the reading, so it is segmented itself; that also gives the period.
    period = 2 * segment(t[used], y[used], _used(sigma, used)).half_period
    moved = displacement_of(observation, t[used], y[used], period)
    segmentation = segment(t[used], moved)
    gain = observation.gain(np.pi / segmentation.half_period)
    noise = _noise_of(segmentation, t[used], y[used], _used(sigma, used))
    scaled = {name: value / gain for name, value in noise.items() if name != "lines"}
    lines = tuple((frequency, size / gain) for frequency, size in noise["lines"])
    return dataclasses.replace(segmentation, **scaled, lines=lines, gain=gain), np.interp(t, t[used], moved)


def _used(sigma: np.ndarray | None, used: np.ndarray) -> np.ndarray | None:
    return sigma if sigma is None or np.ndim(sigma) == 0 else sigma[used]


def displacement_of(observation: Observation, t: np.ndarray, y: np.ndarray, period: float) -> np.ndarray:
    """Return the approximate displacement [m or rad], shape (n,).

    Args:
        observation: the map from the motion to the reading.
        t: times [s], shape (n,).
        y: reading, shape (n,).
        period: duration of a cycle [s].
    """
    if observation.kind == "projection":
        # The pivot lies in the middle of the swing, seen from the equilibrium.
        middle = np.mean(_averages(t, y, period)) - observation.read(np.float64(0.0))
        return np.arcsin(np.clip((y - middle) / observation.length, -1.0, 1.0)) - observation.angle
    measured = t
    t, y = _filled(t, y, period)
    for _ in range(observation.order):
        y = _integrated(t, y - _line(t, y, period))
        y = _without_wander(t, y - np.mean(_averages(t, y, period)))
    return y[np.searchsorted(t, measured)]


def _filled(t: np.ndarray, y: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Fill long gaps by oscillations that fit the samples on both sides.

    The trapezoidal rule integrates an eighth of a period to about a twentieth, and an integral keeps its errors.
    """
    interval, parts = typical_interval(t), [(t, y)]
    for begin in np.flatnonzero(np.diff(t) > period / 8):
        near = (t > t[begin] - period) & (t < t[begin + 1] + period)
        basis = lambda at, middle=t[begin]: _oscillation(2 * np.pi * (at - middle) / period)
        shape = np.linalg.lstsq(basis(t[near]), y[near])[0]
        more = np.arange(t[begin] + interval, t[begin + 1] - interval / 2, interval)
        parts.append((more, basis(more) @ shape))
    if len(parts) == 1:
        return t, y
    times, values = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def _oscillation(phase: np.ndarray) -> np.ndarray:
    """Return columns of an oscillation with linear amplitude, shape (n, 6)."""
    wave = np.stack([np.ones(phase.size), np.cos(phase), np.sin(phase)], axis=1)
    return np.concatenate([wave, phase[:, None] * wave], axis=1)


def _integrated(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Integrate by the trapezoidal rule, from zero."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2)])


def _averages(t: np.ndarray, y: np.ndarray, period: float) -> np.ndarray:
    """Return the averages over the periods that lie inside the record."""
    inside = t[(t >= t[0] + period / 2) & (t <= t[-1] - period / 2)]
    if not inside.size:
        return np.array([np.mean(y)])
    total = _integrated(t, y)
    return (np.interp(inside + period / 2, t, total) - np.interp(inside - period / 2, t, total)) / period


def _line(t: np.ndarray, y: np.ndarray, period: float) -> np.ndarray:
    """Return bias and drift of a reading, shape (n,)."""
    averages = _averages(t, y, period)
    inside = t[(t >= t[0] + period / 2) & (t <= t[-1] - period / 2)]
    # A line needs averages that do not overlap.
    if inside.size < 2 or inside[-1] - inside[0] < period:
        return np.full(t.shape, np.mean(averages))
    u, usual = (inside - inside.mean()) / np.ptp(inside), np.ones(inside.size, bool)
    basis = np.stack([np.ones(u.size), u], axis=1)
    # A hold, a release by hand and a stop make a few averages large.
    for _ in range(_TRIMS):
        line = np.linalg.lstsq(basis[usual], averages[usual])[0]
        off = np.abs(averages - basis @ line)
        usual = off <= _FAR * median(off)
    return line[0] + line[1] * (t - inside.mean()) / np.ptp(inside)


def _without_wander(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Remove the slow error of an integral, shape (n,).

    Noise adds up in an integral. Three turning points on alternating sides show the equilibrium about them,
    (X[n-1] + 2 X[n] + X[n+1])/4.
    """
    segmentation = segment(t, y)
    times, points = segmentation.turning_times, segmentation.turning_points
    if points.size < _FEWEST:
        return y
    return y - np.interp(t, times[1:-1], (points[:-2] + 2 * points[1:-1] + points[2:]) / 4)


def _noise_of(segmentation: Segmentation, t: np.ndarray, y: np.ndarray, sigma: np.ndarray | None) -> dict:
    """Return the noise of the reading, which has kinks at the reversals."""
    stop = () if segmentation.rest is None else (segmentation.rest,)
    edges = np.concatenate([[segmentation.release], segmentation.turning_times, stop])
    step, interval, half_period = resolution(y), typical_interval(t), segmentation.half_period
    white = white_noise(t, y, step, edges) or (0.0 if sigma is None else float(np.median(sigma)))
    cleaned = without_spikes(t, y, max(white, step), interval, int(half_period / interval))
    trace = PreparedTrace(t, cleaned, cleaned, white, step, 0.0, half_period, interval)
    total, drift, lines = disturbance(trace, HalfCycles(edges, segmentation.rest is not None, ()))
    return {"noise": total, "white_noise": white, "resolution": step, "drift": drift, "lines": lines}
