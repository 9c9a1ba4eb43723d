"""Releases and numbers of runs that reach wanted standard errors.

The information of independent runs adds up, so that the standard errors of n equal runs are smaller by the root of n
(Fedorov, Theory of Optimal Experiments, 1972). The information of a run jumps with its number of half-cycles, so the
design compares all given releases and does not search along a gradient.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import UsageError, nearest
from ..oscillator import Oscillator
from ..show import Cell, Report, Reported, Style, Table, axis_label, engineering, figure, scaled, styled
from .fisher import fisher
from .information import Information

# Number of releases in the report.
_LISTED = 8


@dataclasses.dataclass(frozen=True, eq=False)
class Design(Reported):
    """Number of runs that reach the targets, for each release.

    Attributes:
        targets: wanted relative standard error of each coefficient, by name.
        informations: information of one run from each release, in the order of the releases.
        runs: number of runs that reach all targets, inf if no number does, shape (releases,).

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
        """Information of one run from the best release.

        The best release needs the fewest runs. Among several such releases it has the shortest run.
        """
        runs = zip(self.runs, self.informations, strict=True)
        return min(runs, key=lambda each: (each[0], each[1].duration))[1]

    def relative(self, name: str) -> np.ndarray:
        """Return the relative standard error after one run, shape (releases,)."""
        return np.array([each.std_errors[name] / abs(each.values[name]) for each in self.informations])

    def report(self) -> Report:
        """Return the releases in the order of their numbers of runs."""
        rows, relative = [], {name: self.relative(name) for name in self.targets}
        for i in np.argsort(self.runs, kind="stable"):
            each, runs = self.informations[i], self.runs[i]
            count = math.nan if each.motion.half_cycles is None else each.motion.half_cycles
            run = [
                Cell(engineering(each.x0, "m", 4), x0=each.x0),
                Cell(each.motion.half_cycles, half_cycles=count),
                Cell(f"{each.duration:.3g} s", duration=each.duration),
            ]
            errors = [Cell(f"{of[i]:.2g}", **{f"{name}_relative_std": of[i]}) for name, of in relative.items()]
            rows.append([*run, *errors, Cell(f"{runs:.0f}" if np.isfinite(runs) else "none reaches it", runs=runs)])
        heads = ["Release", "Half-cycles", "Record", *(f"u({name})/{name}" for name in self.targets), "Runs"]
        wanted = ", ".join(f"{name} to {target:.2g}" for name, target in self.targets.items())
        facts = [("wanted", wanted), ("noise", f"white, {engineering(self.informations[0].noise, 'm')} a sample")]
        notes = ["The number of runs depends on their noise alone. The uncertainty of the rig does not average out."]
        data = {"targets": self.targets, "releases": self.releases, "runs": self.runs, "relative": relative}
        table = Table(heads, rows, "Releases by the number of runs", {"x0": "m", "duration": "s"}, _LISTED)
        return Report([table], facts, notes, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw relative standard errors and targets against the release, in matplotlib.

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
    """Find the number of runs that each release needs.

    Args:
        oscillator: the machine at the expected values.
        x0: displacements at release to compare [m].
        targets: wanted relative standard error of each coefficient, by name.
        names: coefficients to fit, including those of the targets; None: all coefficients of the model.
        **plan: `rate`, `duration`, `noise`, `nuisance` and `engine` of the runs, see :func:`fisher`.

    Returns:
        The information of one run from each release, and the number of such runs that reach the targets.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: there is no release, a target is not a positive number or not among the names, or `fisher` refuses
            an argument.

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
