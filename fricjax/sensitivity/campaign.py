"""Which releases, and how many of them, determine coefficients as well as is wanted.

The information of runs adds up, so that n equal runs have standard errors smaller by the root of n (Fedorov, Theory of
Optimal Experiments, 1972). How much a run tells jumps where its number of half-cycles does, so that the releases are
gone through and not searched along a slope.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import UsageError, nearest
from ..oscillator import Oscillator
from ..show import Report, Reported, Style, Table, axis_label, engineering, figure, scaled, styled
from .fisher import fisher
from .information import Information

# Rows of a report.
_LISTED = 8


@dataclasses.dataclass(frozen=True, eq=False)
class Design(Reported):
    """Releases by how many runs from each reach what is wanted.

    Attributes:
        targets: wanted relative standard error of each coefficient, by name.
        informations: what one run from each release tells, in the order of the releases.
        runs: number of runs that reach all targets, inf where none do, shape (releases,).

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> plan = fj.sensitivity.design(machine, [0.5e-3, 1e-3, 2e-3], {"mu": 5e-8}, names=["mu", "stiffness"])
        >>> plan.runs.tolist(), plan.best.x0
        ([inf, 6.0, 1.0], 0.002)
    """

    targets: dict[str, float]
    informations: tuple[Information, ...]
    runs: np.ndarray

    @property
    def releases(self) -> np.ndarray:
        """Displacements at release [m], shape (releases,)."""
        return np.array([each.x0 for each in self.informations])

    @property
    def best(self) -> Information:
        """What one run from the release tells that needs the fewest runs; of several the shortest run."""
        runs = zip(self.runs, self.informations, strict=True)
        return min(runs, key=lambda each: (each[0], each[1].duration))[1]

    def relative(self, name: str) -> np.ndarray:
        """Relative standard error of a coefficient after one run from each release, shape (releases,)."""
        return np.array([each.std_errors[name] / abs(each.values[name]) for each in self.informations])

    def report(self) -> Report:
        """The releases that need the fewest runs."""
        rows = []
        for i in np.argsort(self.runs, kind="stable")[:_LISTED]:
            each = self.informations[i]
            cells = [f"{self.relative(name)[i]:.2g}" for name in self.targets]
            runs = f"{self.runs[i]:.0f}" if np.isfinite(self.runs[i]) else "none reaches it"
            rows.append([engineering(each.x0, "m", 4), each.motion.half_cycles, f"{each.duration:.3g} s", *cells, runs])
        heads = ["Release", "Half-cycles", "Record", *(f"u({name})/{name}" for name in self.targets), "Runs"]
        wanted = ", ".join(f"{name} to {target:.2g}" for name, target in self.targets.items())
        facts = [("wanted", wanted), ("noise", f"white, {engineering(self.informations[0].noise, 'm')} a sample")]
        notes = ["The runs are counted by their noise alone: what the rig adds to all of them no number takes away."]
        data = {"targets": self.targets, "releases": self.releases, "runs": self.runs}
        data |= {"relative": {name: self.relative(name) for name in self.targets}}
        return Report([Table(heads, rows, "Releases by the number of runs")], facts, notes, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Relative standard errors after one run against the release, with the targets; a matplotlib figure.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis = axes[0, 0]
        releases, unit = scaled(self.releases, "m")
        for i, (name, target) in enumerate(self.targets.items()):
            (line,) = axis.plot(releases, self.relative(name), "o-", markersize=3, color=f"C{i}", label=name)
            axis.axhline(target, color=line.get_color(), linestyle="--", linewidth=0.8)
        axis.set_yscale("log")
        axis.set_xlabel(axis_label("Release", unit))
        axis.set_ylabel("Relative error of one run")
        axis.legend()
        return styled(drawing, style)


def design(
    oscillator: Oscillator,
    x0: Sequence[float] | np.ndarray,
    targets: Mapping[str, float],
    names: Sequence[str] | None = None,
    **plan: Any,
) -> Design:
    """Which release determines coefficients with the fewest runs.

    Args:
        oscillator: the machine at the values that are expected.
        x0: displacements at release to look at [m].
        targets: relative standard error that is wanted of each coefficient, by name.
        names: coefficients to be fitted, those of the targets among them; None for all that the model has.
        **plan: `rate`, `duration`, `noise`, `nuisance` and `engine` of the runs, as of :func:`fisher`.

    Returns:
        For each release what one run tells, and how many of them reach the targets.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: no release, a target that is no positive number or of what is not fitted, or what `fisher` refuses.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> plan = fj.sensitivity.design(machine, [1e-3, 2e-3], {"mu": 1e-6}, names=["mu", "stiffness"], noise=1e-8)
        >>> print(f"{1e3 * plan.best.x0:.0f} mm, {plan.runs.min():.0f} run")
        2 mm, 1 run
    """
    for name, target in targets.items():
        if not 0 < target < math.inf:
            raise UsageError(f"The target of {name} must be a positive relative standard error, got {target}.")
    informations = tuple(fisher(oscillator, float(start), None, names, **plan) for start in np.ravel(x0))
    if not informations or not targets:
        raise UsageError("A design needs at least one release and one target.")
    for name in targets:
        if name not in informations[0].values:
            known = informations[0].names
            raise UsageError(f"{name} is not fitted.{nearest(name, known)} Fitted are {', '.join(known)}.")
    needed = [
        [(each.std_errors[name] / abs(each.values[name]) / target) ** 2 for name, target in targets.items()]
        for each in informations
    ]
    return Design(dict(targets), informations, np.ceil(np.max(needed, axis=1)))
