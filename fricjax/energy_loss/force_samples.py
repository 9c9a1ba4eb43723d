"""Friction force at each sample: the residual of the equation of motion.

With E the energy of the oscillator, ``dE/dt = v (m a + R(x))``. The rate of energy loss, minus the losses to damping
and drag, divided by the speed, is therefore ``-(m a + R(x) + c v + drag v|v|)`` along the motion. The residual equals
this estimator and avoids a division that fails near zero velocity.
"""

import dataclasses
from typing import Any

import jax
import numpy as np

from ..errors import DataError
from ..oscillator import Oscillator
from .decay import Decay
from .smoothing import Smoothed, smooth

# Smallest speed, relative to the speed that two half-cycles share, for their comparison. Above it the windows are long.
FAST = 0.4
# Number of powers of the speed that describe friction in this comparison. They keep the speed dependence of a law apart
# from a shift of the equilibrium.
POWERS = 3


@dataclasses.dataclass(frozen=True, eq=False)
class ForceSamples:
    """Velocity and friction force in the half-cycles of one record.

    The arrays have shape (n,) and join the half-cycles.

    Attributes:
        smoothed: the half-cycles.
        direction: sign of the velocity in each half-cycle, +1 or -1.
        accelerating: True where the speed grows.
        x, v, a: position from the equilibrium [m], velocity [m/s], acceleration [m/s^2].
        force: friction force [N], positive if it opposes a positive velocity.
        weights: derivatives of minus the force with respect to x, v and a.
        offset, offset_std: equilibrium position in the record [m] and its standard uncertainty.
    """

    smoothed: tuple[Smoothed, ...]
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
        """Velocity in the direction of the half-cycle [m/s].

        Noise can make it negative next to a reversal.
        """
        return self.direction * self.v

    @property
    def ends(self) -> np.ndarray:
        """Index of the first sample of each half-cycle, and number of samples."""
        return np.cumsum([0, *(part.x.size for part in self.smoothed)])

    def std(self, weights: Any = None) -> np.ndarray:
        """Return the standard deviation at each sample [N], shape (n,).

        Args:
            weights: weights of x, v and a; None: those of the force.
        """
        weights = self.weights if weights is None else weights
        parts = zip(*(np.split(w, self.ends[1:-1]) for w in weights), strict=True)
        return np.concatenate([each.std(part) for each, part in zip(self.smoothed, parts, strict=True)])

    def covariance(self, combinations: Any) -> np.ndarray:
        """Return the covariance of linear combinations of the forces [N^2].

        It includes the noise of the samples; shape (c, c).

        Args:
            combinations: sparse or dense matrix, shape (n, c).
        """
        from scipy.sparse import diags_array

        total = 0.0
        for smoothed, first, last in zip(self.smoothed, self.ends[:-1], self.ends[1:], strict=True):
            rows, parts = combinations[first:last], (w[first:last] for w in self.weights)
            dense = isinstance(rows, np.ndarray)
            response = smoothed.response(tuple(w[:, None] * rows if dense else diags_array(w) @ rows for w in parts))
            total = total + smoothed.half_cycle.noise**2 * (response.T @ response)
        return total.toarray() if hasattr(total, "toarray") else np.asarray(total)  # type: ignore[union-attr]


def force_samples(
    decay: Decay,
    oscillator: Oscillator,
    offset: float | None = None,
    window: float | None = None,
    lengthened: float = 1.0,
) -> ForceSamples:
    """Compute the friction force along a decay.

    Args:
        decay: the half-cycles.
        oscillator: mass, restoring force, damping and drag.
        offset: equilibrium position in the record [m]; None: fitted such that friction is equal in both directions,
            because a constant force and a shifted equilibrium have the same effect on a record.
        window: length of the shortest smoothing window [s]; None: selected from the noise.
        lengthened: factor on the lengths of all windows.
    """
    # Midpoints of the half-cycles alternate about the equilibrium by the dead band.
    middle = (decay.points[1:] + decay.points[:-1]) / 2
    centre, band = float(np.median((middle[1:] + middle[:-1]) / 2)), float(np.median(np.abs(np.diff(middle)))) / 2
    acceleration = float(oscillator.angular_frequency) ** 2 * band
    smoothed = tuple(
        smooth(each, window, acceleration=acceleration, lengthened=lengthened) for each in decay.half_cycles
    )
    if offset is not None:
        return _about(smoothed, oscillator, offset, 0.0)
    shift, std = _asymmetry(_about(smoothed, oscillator, centre, 0.0))
    return _about(smoothed, oscillator, centre + shift, std)


def _about(smoothed: tuple[Smoothed, ...], oscillator: Oscillator, offset: float, std: float) -> ForceSamples:
    """Return the forces for an equilibrium at `offset`."""
    position, v, a = (np.concatenate([getattr(each, name) for each in smoothed]) for name in "xva")
    x = position - offset
    restoring, slope = jax.jvp(oscillator.restoring_force, (x,), (np.ones_like(x),))
    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    return ForceSamples(
        smoothed=smoothed,
        direction=np.concatenate([np.full(each.x.size, each.half_cycle.direction) for each in smoothed]),
        accelerating=np.concatenate([np.arange(each.v.size) < np.argmax(np.abs(each.v)) for each in smoothed]),
        x=x,
        v=v,
        a=a,
        force=-(mass * a + np.asarray(restoring) + (damping + drag * np.abs(v)) * v),
        weights=(np.asarray(slope), damping + 2 * drag * np.abs(v), np.full_like(v, mass)),
        offset=offset,
        offset_std=std,
    )


def _asymmetry(samples: ForceSamples) -> tuple[float, float]:
    """Return the shift of the equilibrium with equal friction in both directions.

    The second value is its standard uncertainty; both are in metres. Each half-cycle is compared with the next in the
    upper part of their common speeds. There the force is fitted by the shift and by powers of the speed, times the
    direction, separately for each branch.
    """
    speed, std, ends, estimators = samples.speed, samples.std(), samples.ends, []
    for first, middle, last in zip(ends[:-2], ends[1:-1], ends[2:], strict=True):
        index = np.arange(first, last)
        common = min(speed[first:middle].max(), speed[middle:last].max())
        pair = index[(speed[index] > FAST * common) & (speed[index] <= common)]
        counts = np.bincount(2 * (pair >= middle) + samples.accelerating[pair], minlength=4)
        if counts.min() <= POWERS:
            continue  # a branch of either has fewer samples than the fit has coefficients
        share = speed[pair] / np.max(speed[pair])
        powers = samples.direction[pair, None] * share[:, None] ** np.arange(POWERS)
        rising = samples.accelerating[pair, None]
        basis = np.column_stack([powers * rising, powers * ~rising, -samples.weights[0][pair]])
        estimator = np.zeros_like(std)
        estimator[pair] = np.linalg.pinv(basis / std[pair, None])[-1] / std[pair]
        estimators.append(estimator)
    if not estimators:
        raise DataError(
            "No two half-cycles have enough samples at the same speed to separate friction from the equilibrium; "
            "sample faster, release the mass from farther away, or give the equilibrium as offset."
        )
    precision = [1 / np.sum((estimator * std) ** 2) for estimator in estimators]
    joint = np.average(estimators, axis=0, weights=precision)
    return float(joint @ samples.force), float(samples.covariance(joint[:, None])[0, 0] ** 0.5)
