"""Friction force against velocity from the energy loss (route 4).

Each sample of each half-cycle gives the residual force of the equation of motion (see :mod:`.force_samples`). The map
averages it over ranges of speed, separately for each direction and branch (speed growing or falling). A difference
between the branches is frictional lag. A difference between the directions is tilt or an asymmetric contact.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..data.gather import gather
from ..errors import UsageError
from ..oscillator import ready
from ..rig import Measured, Rig
from ..settings import check_bins
from ..show import (
    Cell,
    Report,
    Reported,
    Style,
    Table,
    axis_label,
    display_unit,
    engineering,
    figure,
    styled,
    uncertain,
)
from ..show.thumbnail import Curve, curves_svg
from .binning import BIAS_SHARE, binned, pooled
from .decay import decay, each_of, frictionless, with_losses
from .force_samples import ForceSamples, force_samples

# Upper end of the lowest range of speeds, in decades below the largest speed.
DECADES_BELOW = 2.5
# Factor of the longer windows that measure the bias of smoothing, which grows with the fourth power of the length.
LONGER = 1.5
_SIDES = {(1, 1): "+ accelerating", (1, -1): "+ decelerating", (-1, 1): "- accelerating", (-1, -1): "- decelerating"}


@dataclasses.dataclass(frozen=True, eq=False)
class ForceMap(Reported):
    """Friction force against velocity, by direction and branch.

    The arrays have shape (n,), with one entry per range, direction and branch.

    Attributes:
        velocity: mean velocity [m/s], with its sign.
        force: friction force [N], positive if it opposes a positive velocity.
        std: standard deviation of the force [N] due to noise, the fitted equilibrium and the bias of smoothing.
        count: number of samples.
        direction: +1 or -1, the sign of the velocity.
        branch: +1 for growing speed, -1 for falling speed.
        edges: limits of the ranges of speed [m/s], shape (bins + 1,).
        mean: friction work divided by path [N], as the weighted mean over the records; its uncertainty has the same
            contributions as `std`.
        normal_force: load on the contact [N].
        damping, drag: viscous [N s/m] and quadratic [N s^2/m^2] coefficients of the subtracted losses.
        offsets: equilibrium position in each record used [m].
        quantity: "m", or "rad" for a rotary rig.
        notes: sentences about skipped records.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> force_map = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig), bins=8)
        >>> force_map.velocity.shape == force_map.force.shape, len(force_map.offsets)
        (True, 1)
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
        """Mean friction force over load [1], without the uncertainty of the rig."""
        return Measured(self.mean.value / self.normal_force, self.mean.std / self.normal_force)

    @property
    def _units(self) -> tuple[str, str]:
        """Units of speed and force."""
        return ("m/s", "N") if self.quantity == "m" else ("rad/s", "N m")

    def report(self) -> Report:
        """Report one row per entry, and a summary of the map."""
        columns = (self.direction.tolist(), self.branch.tolist(), self.velocity, self.force, self.std, self.count)
        speed, force = self._units
        rows = [
            [
                Cell(_SIDES[side, branch], direction=side, branch=branch),
                Cell(float(abs(v)), velocity=v),
                Cell(Measured(abs(f), std), force=f, force_std=std),
                int(n),
            ]
            for side, branch, v, f, std, n in zip(*columns, strict=True)
        ]
        fastest = engineering(float(np.max(np.abs(self.velocity))), speed)
        facts = [
            ("mean friction force", uncertain(self.mean.value, self.mean.std, force)),
            ("coefficient of friction", f"{uncertain(self.mu.value, self.mu.std)} (the rig taken as exact)"),
            ("subtracted", f"damping {self.damping:.6g}, drag {self.drag:.6g} (SI)"),
            ("data", f"{len(self.offsets)} records, {int(self.count.sum())} samples, up to {fastest}"),
        ]
        units = {"velocity": speed, "force": force, "force_std": force}
        table = Table(["Branch", f"Speed [{speed}]", f"Friction force [{force}]", "Samples"], rows, units=units)
        return Report([table], facts, self.notes, heading="Force map", data=vars(self) | {"mu": self.mu})

    def thumbnails(self) -> Sequence[str]:
        speed, force = self._units
        sides = [
            Curve(np.abs(self.velocity[on]), (self.force * self.direction)[on], self.std[on])
            for on in (self.direction > 0, self.direction < 0)
        ]
        return [curves_svg(sides, ("Speed", speed), ("Friction force", force), log_x=True)]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the friction force against speed with two standard deviations.

        Directions and branches have separate symbols.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure(1, 1, heights=(1.5,))
        self.draw(axes[0, 0])
        drawing.legend(loc="outside upper center", ncols=2, fontsize=8)
        return styled(drawing, style)

    def draw(self, axes: Any) -> tuple[float, float]:
        """Draw the map as `plot` does.

        Returns:
            The factors from m/s and N to the units of the axes.
        """
        speed, force = self._units
        factor_v, unit_v = display_unit(float(np.max(np.abs(self.velocity))), speed)
        factor_f, unit_f = display_unit(abs(self.mean.value), force)
        for (direction, branch), marker in zip(_SIDES, "os^v", strict=True):
            on = (self.direction == direction) & (self.branch == branch)
            value, std = factor_f * (self.force * self.direction)[on], 2 * factor_f * self.std[on]
            points = {"linestyle": "none", "marker": marker, "markersize": 3, "label": _SIDES[direction, branch]}
            axes.errorbar(factor_v * np.abs(self.velocity[on]), value, std, **points)
        axes.set_xscale("log")
        axes.set_xlabel(axis_label("Speed", unit_v))
        axes.set_ylabel(axis_label("Friction force", unit_f))
        return factor_v, factor_f


def friction_force_map(
    records: Any,
    rig: Rig,
    no_contact: Any = None,
    *,
    bins: Any = 24,
    offset: float | None = None,
    window: float | None = None,
) -> ForceMap:
    """Measure the friction force against velocity in free decays.

    The map uses the half-cycles after the first reversal, which the release does not disturb.

    Args:
        records: a run, or a list of runs of one machine, each as for :func:`fricjax.fit`; they are pooled.
        rig: mass, restoring force, load, and the damping and drag to subtract.
        no_contact: a run without contact; its damping and drag replace those of the rig.
        bins: number of ranges of speed, from rest to the largest speed, or their increasing limits [m/s].
        offset: equilibrium position in the records [m]; None: fitted in each record such that friction is equal in both
            directions. A difference between the directions, such as by tilt, is then part of the offset.
        window: length of the shortest smoothing window [s], next to reversals; None: selected from the noise.

    Returns:
        The map. Its standard deviations exclude the uncertainties of the rig.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: an unusable record: uneven sampling, or too few half-cycles.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> force_map = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig))
        >>> round(force_map.mu.value, 4)
        0.02
    """
    ready()
    oscillator = frictionless(with_losses(rig, no_contact))
    records = gather(records)

    def evaluate(record: Any) -> tuple[ForceSamples, ForceSamples]:
        """Return the forces at all samples, with normal and longer windows."""
        half_cycles = decay(record, 2 if offset is None else 1)
        samples = force_samples(half_cycles, oscillator, offset, window)
        return samples, force_samples(half_cycles, oscillator, samples.offset, window, LONGER)

    evaluations, notes = each_of(records, evaluate)
    edges = _edges(bins, max(float(np.max(samples.speed)) for samples, _ in evaluations))
    means = [_work_over_path(*pair) for pair in evaluations]
    return ForceMap(
        **pooled([binned(*pair, edges) for pair in evaluations], edges),
        edges=edges,
        mean=weighted(means),
        normal_force=float(oscillator.normal_force),
        damping=float(oscillator.damping),
        drag=float(oscillator.drag),
        offsets=tuple(Measured(samples.offset, samples.offset_std) for samples, _ in evaluations),
        quantity=records[0].quantity,
        notes=notes,
    )


def _edges(bins: Any, fastest: float) -> np.ndarray:
    """Return the limits of the ranges of speed [m/s].

    They are as given, or zero followed by a geometric series up to the largest speed.
    """
    if np.ndim(bins) == 0:
        check_bins(bins)
        return np.append(0.0, fastest * np.geomspace(10**-DECADES_BELOW, 1 + 1e-12, int(bins)))
    edges = np.asarray(bins, float)
    if edges.ndim != 1 or edges.size < 2 or not np.all(np.diff(edges) > 0) or edges[0] < 0:
        raise UsageError(f"The limits of bins must be speeds in m/s that increase from zero or more, got {bins!r}.")
    return edges


def _work_over_path(samples: ForceSamples, longer: ForceSamples) -> Measured:
    """Return friction work divided by path for one record [N]."""
    share = samples.v / np.sum(samples.speed)
    equilibrium = share @ samples.weights[0] * samples.offset_std
    bias = BIAS_SHARE * (share @ (longer.force - samples.force))
    variance = samples.covariance(share[:, None])[0, 0] + equilibrium**2 + bias**2
    return Measured(float(share @ samples.force), float(variance**0.5))


def weighted(values: list[Measured]) -> Measured:
    """Return the mean of independent values, weighted by inverse variance."""
    weight = np.array([each.std**-2 for each in values])
    mean = float(weight @ np.array([each.value for each in values]) / weight.sum())
    return Measured(mean, float(weight.sum() ** -0.5))
