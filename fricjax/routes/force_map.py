"""The friction force against velocity, from the rate at which a free decay loses energy (evaluation route 4).

Every sample of every stroke tells the force that the equation of motion leaves over (see :mod:`.sampled`). Samples of
one direction and one branch (the speed still grows, or falls again) are averaged over a range of speeds; a difference
between the branches is frictional lag, one between the directions is tilt or an asymmetric contact.
"""

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from ..calibrate import Measured, Rig
from ..data import Record, Trace
from ..data.errors import UsageError
from ..oscillator import require_x64
from .no_contact import contactless
from .sampled import Sampled, sampled
from .strokes import decays

DECADES_BELOW = 2.5  # of the largest speed: where the lowest range of speeds ends
ENOUGH = 12  # samples in a cell for a parabola
LONGER = 1.5  # windows for the bias of smoothing, which grows with the fourth power of their length
BIAS_SHARE = 0.5  # of what the longer windows change; twice what the fourth power leaves for the shorter ones


@dataclasses.dataclass(frozen=True, eq=False)
class ForceMap:
    """Friction force against velocity; arrays of shape (n,), one entry for each range, direction and branch with samples.

    Attributes:
        velocity: mean velocity [m/s], with its sign.
        force: friction force [N], positive where it opposes a positive velocity.
        std: standard deviation of the force by the noise of the records, the equilibrium found and the bias of smoothing [N].
        count: number of samples.
        direction: +1 or -1, the sign of the velocity.
        branch: +1 where the speed grows, -1 where it falls.
        edges: limits of the ranges of speed [m/s], shape (bins + 1,).
        mean: friction work divided by path [N], over all samples.
        normal_force: load on the contact [N].
        damping, drag: viscous [N s/m] and quadratic [N s^2/m^2] coefficients of the losses that were subtracted.
        offsets: equilibrium position in each record used [m].
        quantity: "m", or "rad" for a rotary rig.
        notes: sentences on records that were left out.
    """

    velocity: np.ndarray
    force: np.ndarray
    std: np.ndarray
    count: np.ndarray
    direction: np.ndarray
    branch: np.ndarray
    edges: np.ndarray
    mean: Measured
    normal_force: float
    damping: float
    drag: float
    offsets: tuple[Measured, ...]
    quantity: str
    notes: tuple[str, ...]

    @property
    def mu(self) -> Measured:
        """Mean friction force over the load [1], with the uncertainty of the force alone."""
        return Measured(self.mean.value / self.normal_force, self.mean.std / self.normal_force)

    def summary(self) -> str:
        """The map as plain text."""
        from .force_show import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from .force_show import html

        return html(self)

    def plot(self) -> Any:
        """Friction force against speed with error bars, as a matplotlib figure."""
        from .force_show import plot

        return plot(self)

    def to_dict(self) -> dict[str, Any]:
        """The map as plain data."""
        from .force_show import to_dict

        return to_dict(self)


def friction_force_map(
    records: Any,
    rig: Rig,
    no_contact: Record | Trace | None = None,
    *,
    bins: Any = 24,
    offset: float | None = None,
    window: float | None = None,
) -> ForceMap:
    """Friction force against velocity from free decays.

    Used are the half-cycles after the first reversal, which the release no longer disturbs.

    Args:
        records: a record or trace, or several of one machine, which are pooled.
        rig: mass, restoring force, load, and the damping and drag to subtract.
        no_contact: a run without contact, from which damping and drag are fitted in place of those of the rig.
        bins: number of ranges of speed, from rest to the largest speed, or their limits [m/s], increasing.
        offset: equilibrium position in the records [m]; None: found in each record, as the one about which friction is
            equally large in both directions. The difference between them, as by tilt, then is a part of the offset.
        window: length of the shortest smoothing window [s], used next to reversals; None: as the noise asks for.

    Returns:
        The map. Uncertainties of the rig are not in its standard deviations.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: a record that cannot be used: sampled unevenly, or with too few half-cycles.
    """
    require_x64()
    oscillator = contactless(rig, no_contact)
    found, notes = decays(records, 2 if offset is None else 1)
    forces = [sampled(decay, oscillator, offset, window) for decay in found]
    longer = [
        sampled(decay, oscillator, force.offset, window, LONGER) for decay, force in zip(found, forces, strict=True)
    ]
    edges = _edges(bins, max(float(np.max(force.speed)) for force in forces))
    first = records[0] if isinstance(records, list | tuple) else records
    return ForceMap(
        **_binned([_cells(*pair, edges) for pair in zip(forces, longer, strict=True)], edges),
        edges=edges,
        mean=mean_force(forces),
        normal_force=float(oscillator.normal_force),
        damping=float(oscillator.damping),
        drag=float(oscillator.drag),
        offsets=tuple(Measured(force.offset, force.offset_std) for force in forces),
        quantity=getattr(first, "quantity", "m"),
        notes=notes,
    )


def _edges(bins: Any, fastest: float) -> np.ndarray:
    """Limits of the ranges of speed [m/s]: given, or from rest in equal ratios to the largest speed."""
    if np.ndim(bins) == 0:
        if not isinstance(bins, int | np.integer) or bins < 2:
            raise UsageError(f"bins must be a whole number of at least 2, or limits in m/s, got {bins!r}.")
        return np.append(0.0, fastest * np.geomspace(10**-DECADES_BELOW, 1 + 1e-12, int(bins)))
    edges = np.asarray(bins, float)
    if edges.ndim != 1 or edges.size < 2 or not np.all(np.diff(edges) > 0) or edges[0] < 0:
        raise UsageError(f"The limits of bins must be speeds in m/s that increase from zero or more, got {bins!r}.")
    return edges


def _binned(cells: list["_Cells"], edges: np.ndarray) -> dict[str, np.ndarray]:
    """Weighted means over all records of ranges, directions and branches that hold samples."""
    force, speed, variance, count = (np.array([getattr(each, name) for each in cells]) for name in _Cells._fields)
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


class _Cells(NamedTuple):
    """Force at the mean speed, mean speed, variance of the force and number of samples in each cell of one record.

    A cell is a range of speeds in one direction and one branch, shape (4 ranges,); without samples its variance is
    infinite.
    """

    force: np.ndarray
    speed: np.ndarray
    variance: np.ndarray
    count: np.ndarray


def _cells(found: Sampled, longer: Sampled, edges: np.ndarray) -> _Cells:
    """The cells of one record; what longer windows change shows how much of the force the windows smooth away."""
    place, ranges = np.searchsorted(edges, found.speed, side="right") - 1, edges.size - 1
    cell = place + ranges * (2 * (found.direction < 0) + ~found.accelerating)
    cell = np.where((place >= 0) & (place < ranges), cell, 4 * ranges)
    means, shares = _shares(found, cell, 4 * ranges)
    bias = BIAS_SHARE * (means.T @ (longer.force - found.force))
    equilibrium = means.T @ found.weights[0] * found.offset_std
    count = np.bincount(cell, minlength=4 * ranges)[: 4 * ranges]
    variance = np.diag(found.covariance(means)) + equilibrium**2 + bias**2
    return _Cells(means.T @ found.force, shares.T @ found.speed, np.where(count > 0, variance, np.inf), count)


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


def mean_force(forces: list[Sampled]) -> Measured:
    """Friction work divided by the path, over all samples of all records [N]."""
    path = sum(float(np.sum(found.speed)) for found in forces)
    value, variance = 0.0, 0.0
    for found in forces:
        share = found.v / path
        shifted = float(share @ found.weights[0]) * found.offset_std
        value += float(share @ found.force)
        variance += found.covariance(share[:, None])[0, 0] + shifted**2
    return Measured(value, float(variance**0.5))


