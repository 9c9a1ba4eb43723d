"""Averages of the friction force over speed, by direction and branch."""

from typing import NamedTuple

import numpy as np

from .force_samples import ForceSamples

# Smallest bin for a parabola instead of a mean. A parabola does not bias a force that curves within the bin.
ENOUGH = 12
# Ratio of the bias to the change with longer windows. The bias grows with the fourth power of the length, and 1.5^4 - 1
# is about 4; the factor includes a margin of two.
BIAS_SHARE = 0.5


class Binned(NamedTuple):
    """The bins of one record: force, mean speed, variance and count.

    A bin is a range of speeds in one direction and one branch; arrays of shape (4 ranges,). The force is that at the
    mean speed. The variance is infinite for a bin without samples.
    """

    force: np.ndarray
    speed: np.ndarray
    variance: np.ndarray
    count: np.ndarray


def binned(samples: ForceSamples, longer: ForceSamples, edges: np.ndarray) -> Binned:
    """Average the samples of one record in bins.

    The change of the force with `longer` windows measures the bias of smoothing.
    """
    from scipy.sparse import csr_array

    place, ranges = np.searchsorted(edges, samples.speed, side="right") - 1, edges.size - 1
    bins = 4 * ranges
    of_sample = place + ranges * (2 * (samples.direction < 0) + ~samples.accelerating)
    of_sample = np.where((place >= 0) & (place < ranges), of_sample, bins)
    order = np.argsort(of_sample, kind="stable")
    groups = np.split(order, np.searchsorted(of_sample[order], np.arange(1, bins + 1)))[:-1]
    precision = 1 / samples.std() ** 2
    weights = [_weights(samples.speed[group], precision[group]) for group in groups]
    where = np.concatenate(groups), np.repeat(np.arange(bins), [group.size for group in groups])
    # Weights of the samples in the force and in the mean speed of each bin.
    of_force, of_speed = (
        csr_array((np.concatenate([pair[i] for pair in weights]), where), (of_sample.size, bins)) for i in range(2)
    )
    bias = BIAS_SHARE * (of_force.T @ (longer.force - samples.force))
    equilibrium = of_force.T @ samples.weights[0] * samples.offset_std
    count = np.bincount(of_sample, minlength=bins)[:bins]
    variance = np.diag(samples.covariance(of_force)) + equilibrium**2 + bias**2
    variance = np.where(count > 0, variance, np.inf)
    return Binned(of_force.T @ samples.force, of_speed.T @ samples.speed, variance, count)


def _weights(speed: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights for the force at mean speed, and that speed.

    The force comes from a parabola through the samples.
    """
    mean = precision / precision.sum()
    if speed.size < ENOUGH:
        return mean, mean
    from_mean = speed - mean @ speed
    root = np.sqrt(precision)
    powers = (from_mean / np.ptp(speed))[:, None] ** np.arange(3)
    return np.linalg.pinv(powers * root[:, None])[0] * root, mean


def pooled(records: list[Binned], edges: np.ndarray) -> dict[str, np.ndarray]:
    """Average the non-empty bins over all records, with weights.

    The keys are the fields of a force map.
    """
    force, speed, variance, count = (np.array(column) for column in zip(*records, strict=True))
    filled = np.flatnonzero(count.sum(axis=0))
    weight = 1 / variance[:, filled]
    total = weight.sum(axis=0)
    side, branch = np.divmod(filled // (edges.size - 1), 2)
    return {
        "velocity": (1 - 2 * side) * (weight * speed[:, filled]).sum(axis=0) / total,
        "force": (weight * force[:, filled]).sum(axis=0) / total,
        "std": total**-0.5,
        "count": count[:, filled].sum(axis=0),
        "direction": 1 - 2 * side,
        "branch": 1 - 2 * branch,
    }
