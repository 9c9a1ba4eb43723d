"""Samples of friction force gathered by speed, direction and branch."""

from typing import Any, NamedTuple

import numpy as np

from .force_samples import Sampled

ENOUGH = 12  # samples in a cell for a parabola
BIAS_SHARE = (
    0.5  # of what longer windows change; with windows half as long again, twice what is left by the fourth power
)


class Cells(NamedTuple):
    """Force at the mean speed, mean speed, variance of the force and number of samples in each cell of one record.

    A cell is a range of speeds in one direction and one branch, shape (4 ranges,); without samples its variance is
    infinite.
    """

    force: np.ndarray
    speed: np.ndarray
    variance: np.ndarray
    count: np.ndarray


def cells(found: Sampled, longer: Sampled, edges: np.ndarray) -> Cells:
    """The cells of one record; what longer windows change shows how much of the force the windows smooth away."""
    place, ranges = np.searchsorted(edges, found.speed, side="right") - 1, edges.size - 1
    cell = place + ranges * (2 * (found.direction < 0) + ~found.accelerating)
    cell = np.where((place >= 0) & (place < ranges), cell, 4 * ranges)
    means, shares = _shares(found, cell, 4 * ranges)
    bias = BIAS_SHARE * (means.T @ (longer.force - found.force))
    equilibrium = means.T @ found.weights[0] * found.offset_std
    count = np.bincount(cell, minlength=4 * ranges)[: 4 * ranges]
    variance = np.diag(found.covariance(means)) + equilibrium**2 + bias**2
    return Cells(means.T @ found.force, shares.T @ found.speed, np.where(count > 0, variance, np.inf), count)


def _shares(found: Sampled, cell: np.ndarray, cells: int) -> tuple[Any, Any]:
    """What the samples weigh in the force and in the mean speed of each cell: two sparse matrices, shape (n, cells)."""
    from scipy.sparse import csr_array

    order = np.argsort(cell, kind="stable")
    groups = np.split(order, np.searchsorted(cell[order], np.arange(1, cells + 1)))[:-1]
    precision = 1 / found.std() ** 2
    weights = [_weights(found.speed[group], precision[group]) for group in groups]
    rows, columns = np.concatenate(groups), np.repeat(np.arange(cells), [group.size for group in groups])
    force, speed = (np.concatenate([pair[i] for pair in weights]) for i in range(2))
    shape = (cell.size, cells)
    return csr_array((force, (rows, columns)), shape), csr_array((speed, (rows, columns)), shape)


def _weights(speed: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of samples for the force at their mean speed, from a parabola through them, and for that mean speed."""
    mean = precision / precision.sum()
    if speed.size < ENOUGH:
        return mean, mean
    from_mean = speed - mean @ speed
    root = np.sqrt(precision)
    powers = (from_mean / np.ptp(speed))[:, None] ** np.arange(3)
    return np.linalg.pinv(powers * root[:, None])[0] * root, mean


def pooled(found: list["Cells"], edges: np.ndarray) -> dict[str, np.ndarray]:
    """Weighted means over all records of ranges, directions and branches that hold samples."""
    force, speed, variance, count = (np.array([getattr(each, name) for each in found]) for name in Cells._fields)
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
