"""Friction force at every sample of a decay: what the equation of motion leaves over.

With E the energy of the oscillator, ``dE/dt = v (m a + R(x))``, so that the rate of energy loss less the viscous and
the windage loss, divided by the speed, is ``-(m a + R(x) + c v + drag v|v|)`` along the motion. The residual is the
same estimator as the rate of energy loss, without a division that fails near zero velocity.
"""

import dataclasses
from typing import Any

import jax
import numpy as np

from ..errors import DataError
from ..oscillator import Oscillator
from .decay import Decay
from .smoothing import Motion, smooth

FAST = 0.4  # of the speed that two strokes reach: above it they are compared
POWERS = 3  # of the speed, that friction is described with in this comparison


@dataclasses.dataclass(frozen=True, eq=False)
class Sampled:
    """The strokes of one record with velocity and friction force; all arrays of shape (n,), stroke after stroke.

    Attributes:
        motions: the smoothed strokes.
        direction: sign of the velocity in each stroke, +1 or -1.
        accelerating: whether the speed still grows.
        x, v, a: position from the equilibrium [m], velocity [m/s], acceleration [m/s^2].
        force: friction force [N], positive where it opposes a positive velocity.
        weights: derivatives of minus the force with respect to x, v and a.
        offset, offset_std: equilibrium position in the record [m] and its standard uncertainty.
    """

    motions: tuple[Motion, ...]
    direction: np.ndarray
    accelerating: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: np.ndarray
    weights: tuple[np.ndarray, np.ndarray, np.ndarray]
    offset: float
    offset_std: float

    @property
    def speed(self) -> np.ndarray:
        """Velocity in the direction of the stroke [m/s]; the noise makes it negative next to a reversal."""
        return self.direction * self.v

    def std(self, weights: Any = None) -> np.ndarray:
        """Standard deviation of the force at each sample, or of other weights of x, v and a [N], shape (n,)."""
        parts = self._split(self.weights if weights is None else weights)
        return np.concatenate([motion.std(part) for motion, part in zip(self.motions, parts, strict=True)])

    def covariance(self, combinations: Any, weights: Any = None) -> np.ndarray:
        """Covariance by the noise of the samples of linear combinations of the forces [N^2], shape (c, c).

        Args:
            combinations: sparse or dense matrix, shape (n, c).
            weights: of x, v and a at each sample, in place of those of the force.
        """
        total, first = 0.0, 0
        parts = self._split(self.weights if weights is None else weights)
        for motion, part in zip(self.motions, parts, strict=True):
            rows = combinations[first : first + motion.x.size]
            seen = motion.response(tuple(_scaled(w, rows) for w in part))
            total = total + motion.stroke.noise**2 * (seen.T @ seen)
            first += motion.x.size
        return total.toarray() if hasattr(total, "toarray") else np.asarray(total)  # type: ignore[union-attr]

    def _split(self, weights: Any) -> list[Any]:
        ends = np.cumsum([motion.x.size for motion in self.motions])[:-1]
        return list(zip(*(np.split(w, ends) for w in weights), strict=True))


def _scaled(weights: np.ndarray, rows: Any) -> Any:
    """Rows of a matrix times their weights."""
    if isinstance(rows, np.ndarray):
        return weights[:, None] * rows
    from scipy.sparse import diags_array

    return diags_array(weights) @ rows


def sampled(
    decay: Decay,
    oscillator: Oscillator,
    offset: float | None = None,
    window: float | None = None,
    lengthened: float = 1.0,
) -> Sampled:
    """Friction force along a decay.

    Args:
        decay: the strokes.
        oscillator: mass, restoring force, damping and drag.
        offset: equilibrium position in the record [m]; None: found where friction is equally large in both directions,
            for a constant force acts like a shifted equilibrium and no record tells one from the other.
        window: length of the shortest smoothing window [s]; None: as the noise asks for.
        lengthened: factor on the lengths of all windows.
    """
    centre, band = _centre(decay.points)
    rate = float(oscillator.angular_frequency) ** 2
    settings = {"acceleration": rate * band, "lengthened": lengthened}
    motions = tuple(smooth(stroke, window, **settings) for stroke in decay.strokes)
    if offset is not None:
        return _at(motions, oscillator, offset, 0.0)
    shift, std = _asymmetry(_at(motions, oscillator, centre, 0.0))
    return _at(motions, oscillator, centre + shift, std)


def _centre(points: np.ndarray) -> tuple[float, float]:
    """Rough equilibrium and dead band: midpoints of the strokes alternate about the one by the other."""
    middle = (points[1:] + points[:-1]) / 2
    return float(np.median((middle[1:] + middle[:-1]) / 2)), float(np.median(np.abs(np.diff(middle)))) / 2


def _at(motions: tuple[Motion, ...], oscillator: Oscillator, offset: float, std: float) -> Sampled:
    """The forces with the equilibrium at `offset`."""
    position, v, a = (np.concatenate([getattr(motion, name) for motion in motions]) for name in "xva")
    x = position - offset
    restoring, slope = jax.jvp(oscillator.restoring_force, (x,), (np.ones_like(x),))
    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    return Sampled(
        motions=motions,
        direction=np.concatenate([np.full(motion.x.size, motion.stroke.direction) for motion in motions]),
        accelerating=np.concatenate([_accelerating(motion) for motion in motions]),
        x=x,
        v=v,
        a=a,
        force=-(mass * a + np.asarray(restoring) + (damping + drag * np.abs(v)) * v),
        weights=(np.asarray(slope), damping + 2 * drag * np.abs(v), np.full_like(v, mass)),
        offset=offset,
        offset_std=std,
    )


def _accelerating(motion: Motion) -> np.ndarray:
    """Up to the largest speed of the stroke."""
    return np.arange(motion.v.size) < np.argmax(np.abs(motion.v))


def _asymmetry(found: Sampled) -> tuple[float, float]:
    """Shift of the equilibrium that makes friction equally large in both directions [m], and its standard uncertainty.

    Each stroke is compared with the next over the upper part of the speeds that both reach.
    """
    ends = np.cumsum([0, *(motion.x.size for motion in found.motions)])
    std = found.std()
    pairs = [_common(found, *three) for three in zip(ends[:-2], ends[1:-1], ends[2:], strict=True)]
    estimators = [_comparison(found, pair, std) for pair in pairs if pair.size]
    if not estimators:
        raise DataError(
            "No two half-cycles have enough samples at the same speed to tell friction from the equilibrium; sample "
            "faster, release the mass from farther away, or give the equilibrium as offset."
        )
    precision = [1 / np.sum((estimator * std) ** 2) for estimator in estimators]
    joint = np.average(estimators, axis=0, weights=precision)
    return float(joint @ found.force), float(found.covariance(joint[:, None])[0, 0] ** 0.5)


def _common(found: Sampled, first: int, middle: int, last: int) -> np.ndarray:
    """Samples of two strokes at the upper part of the speeds that both reach; none where a branch of either has few."""
    speed, index = found.speed, np.arange(first, last)
    common = min(speed[first:middle].max(), speed[middle:last].max())
    pair = index[(speed[index] > FAST * common) & (speed[index] <= common)]
    counts = np.bincount(2 * (pair >= middle) + found.accelerating[pair], minlength=4)
    return pair if counts.min() > POWERS else pair[:0]


def _comparison(found: Sampled, pair: np.ndarray, std: np.ndarray) -> np.ndarray:
    """What to weigh the forces with, shape (n,), to get the shift of the equilibrium from some samples of two strokes.

    There the force is fitted with powers of the speed, for each branch its own, times the direction, and the shift.
    """
    share = found.speed[pair] / np.max(found.speed[pair])
    powers = found.direction[pair, None] * share[:, None] ** np.arange(POWERS)
    rising = found.accelerating[pair, None]
    basis = np.column_stack([powers * rising, powers * ~rising, -found.weights[0][pair]])
    estimator = np.zeros_like(std)
    estimator[pair] = np.linalg.pinv(basis / std[pair, None])[-1] / std[pair]
    return estimator
