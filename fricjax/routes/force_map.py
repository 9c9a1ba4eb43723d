"""The friction force against velocity, from the rate at which a free decay loses energy (evaluation route 4).

Every sample of every stroke tells the force that the equation of motion leaves over (see :mod:`.sampled`). Samples of
one direction and one branch (the speed still grows, or falls again) are averaged over a range of speeds; a difference
between the branches is frictional lag, one between the directions is tilt or an asymmetric contact.
"""

import dataclasses
from typing import Any

import numpy as np

from ..calibrate import Measured, Rig
from ..data import Record, Trace
from ..data.errors import UsageError
from ..oscillator import require_x64
from .no_contact import contactless
from .sampled import Sampled, sampled
from .strokes import decays

DECADES_BELOW = 2.5  # of the largest speed: where the lowest range of speeds ends


@dataclasses.dataclass(frozen=True, eq=False)
class ForceMap:
    """Friction force against velocity; arrays of shape (n,), one entry for each range, direction and branch with samples.

    Attributes:
        velocity: mean velocity [m/s], with its sign.
        force: friction force [N], positive where it opposes a positive velocity.
        std: standard deviation of the force from the noise of the records and from the equilibrium found [N].
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
    edges = _edges(bins, max(float(np.max(force.speed)) for force in forces))
    first = records[0] if isinstance(records, list | tuple) else records
    return ForceMap(
        **_binned(forces, edges),
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


def _binned(forces: list[Sampled], edges: np.ndarray) -> dict[str, np.ndarray]:
    """Weighted means over all ranges, directions and branches that hold samples."""
    values = np.array([_of_one(force, edges) for force in forces])
    mean, speed, variance, count = np.moveaxis(values, 1, 0)
    weight = np.where(count > 0, 1 / variance, 0.0)
    filled = np.flatnonzero(count.sum(axis=0))
    total = weight.sum(axis=0)[filled]
    mean, speed = ((weight * each).sum(axis=0)[filled] / total for each in (mean, speed))
    side, rest = np.divmod(filled, 2 * (edges.size - 1))
    direction, branch = 1 - 2 * side, 1 - 2 * (rest // (edges.size - 1))
    return {
        "velocity": direction * speed,
        "force": mean,
        "std": total**-0.5,
        "count": count.sum(axis=0)[filled].astype(int),
        "direction": direction,
        "branch": branch,
    }


def _of_one(found: Sampled, edges: np.ndarray) -> tuple[np.ndarray, ...]:
    """Mean force, mean speed, variance and number of samples in each cell of one record; infinite where there are none."""
    from scipy.sparse import csr_array

    ranges = edges.size - 1
    place = np.searchsorted(edges, found.speed, side="right") - 1
    used = np.flatnonzero((place >= 0) & (place < ranges))
    cell = place + ranges * (2 * (found.direction < 0) + ~found.accelerating)
    weight = 1 / found.std() ** 2
    total = np.bincount(cell[used], weight[used], 4 * ranges)
    filled = np.where(total > 0, total, 1.0)
    share = csr_array((weight[used] / filled[cell[used]], (used, cell[used])), shape=(weight.size, 4 * ranges))
    shifted = share.T @ found.weights[0] * found.offset_std
    variance = np.diag(found.covariance(share)) + shifted**2
    count = np.bincount(cell[used], minlength=4 * ranges)
    return share.T @ found.force, share.T @ found.speed, np.where(count > 0, variance, np.inf), count


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


