"""The friction force against velocity, from the rate at which a free decay loses energy (evaluation route 4).

Every sample of every stroke tells the force that the equation of motion leaves over (see :mod:`.sampled`). Samples of
one direction and one branch (the speed still grows, or falls again) are averaged over a range of speeds; a difference
between the branches is frictional lag, one between the directions is tilt or an asymmetric contact.
"""

import dataclasses
from typing import Any

import numpy as np

from ..data.gather import gather
from ..errors import UsageError
from ..oscillator import Oscillator, ready
from ..pairs.settings import check_bins
from ..rig import Measured, Rig
from .cells import BIAS_SHARE, cells, pooled
from .decay import decay, each_of
from .force_samples import Sampled, sampled
from .no_contact import contactless

DECADES_BELOW = 2.5  # of the largest speed: where the lowest range of speeds ends
LONGER = 1.5  # windows for the bias of smoothing, which grows with the fourth power of their length


@dataclasses.dataclass(frozen=True, eq=False)
class ForceMap:
    """Friction force against velocity; arrays of shape (n,), one entry per range, direction and branch.

    Attributes:
        velocity: mean velocity [m/s], with its sign.
        force: friction force [N], positive where it opposes a positive velocity.
        std: standard deviation of the force [N], by the noise of the records, the equilibrium found and the bias of
            smoothing.
        count: number of samples.
        direction: +1 or -1, the sign of the velocity.
        branch: +1 where the speed grows, -1 where it falls.
        edges: limits of the ranges of speed [m/s], shape (bins + 1,).
        mean: friction work divided by path [N], the weighted mean over the records; its uncertainty as
            that of the forces.
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
    no_contact: Any = None,
    *,
    bins: Any = 24,
    offset: float | None = None,
    window: float | None = None,
) -> ForceMap:
    """Friction force against velocity from free decays.

    Used are the half-cycles after the first reversal, which the release no longer disturbs.

    Args:
        records: a run, or a list of runs of one machine, each given as to :func:`fricjax.fit`; they are pooled.
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

    ```python
    fricjax.friction_force_map(["run1.csv", "run2.csv"], rig, "free.csv").plot()
    ```
    """
    ready()
    oscillator = contactless(rig, no_contact)
    records = gather(records)
    pairs, notes = each_of(records, lambda record: _forces(record, oscillator, offset, window))
    forces = [found for found, _ in pairs]
    edges = _edges(bins, max(float(np.max(force.speed)) for force in forces))
    return ForceMap(
        **pooled([cells(*pair, edges) for pair in pairs], edges),
        edges=edges,
        mean=_mean(pairs),
        normal_force=float(oscillator.normal_force),
        damping=float(oscillator.damping),
        drag=float(oscillator.drag),
        offsets=tuple(Measured(force.offset, force.offset_std) for force in forces),
        quantity=records[0].quantity,
        notes=notes,
    )


def _forces(record: Any, oscillator: Oscillator, offset: float | None, window: float | None) -> tuple[Sampled, Sampled]:
    """Forces at every sample, with smoothing windows as they should be and with longer ones."""
    found = decay(record, 2 if offset is None else 1)
    forces = sampled(found, oscillator, offset, window)
    return forces, sampled(found, oscillator, forces.offset, window, LONGER)


def _edges(bins: Any, fastest: float) -> np.ndarray:
    """Limits of the ranges of speed [m/s]: given, or from rest in equal ratios to the largest speed."""
    if np.ndim(bins) == 0:
        check_bins(bins)
        return np.append(0.0, fastest * np.geomspace(10**-DECADES_BELOW, 1 + 1e-12, int(bins)))
    edges = np.asarray(bins, float)
    if edges.ndim != 1 or edges.size < 2 or not np.all(np.diff(edges) > 0) or edges[0] < 0:
        raise UsageError(f"The limits of bins must be speeds in m/s that increase from zero or more, got {bins!r}.")
    return edges


def _mean(pairs: list[tuple[Sampled, Sampled]]) -> Measured:
    """Friction work divided by the path of each record, and of these the weighted mean [N]."""
    means = [_work_over_path(*pair) for pair in pairs]
    weight = np.array([mean.std**-2 for mean in means])
    values = np.array([mean.value for mean in means])
    return Measured(float(weight @ values / weight.sum()), float(weight.sum() ** -0.5))


def _work_over_path(found: Sampled, longer: Sampled) -> Measured:
    """Friction work divided by the path of one record [N]."""
    share = found.v / np.sum(found.speed)
    equilibrium = share @ found.weights[0] * found.offset_std
    bias = BIAS_SHARE * (share @ (longer.force - found.force))
    variance = found.covariance(share[:, None])[0, 0] + equilibrium**2 + bias**2
    return Measured(float(share @ found.force), float(variance**0.5))
