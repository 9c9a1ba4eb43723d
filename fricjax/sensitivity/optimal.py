"""Optimal releases and loads of a series of runs.

The information of runs adds up after the nuisance parameters of each run are eliminated. The criterion is minus the
logarithm of its determinant (D-optimal), or the logarithm of the sum of squared ratios of standard errors to targets
(c-optimal; Fedorov, Theory of Optimal Experiments, 1972; Pukelsheim, Optimal Design of Experiments, 2006). It is smooth
in the release and the load for a constant number of half-cycles, and jumps with that number. So the design adds one run
at a time: the best of a grid of releases, then improved along the gradient for the same number of half-cycles.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..errors import UsageError, nearest
from ..fitting.names import find_leaf
from ..fitting.residual import Residual
from ..oscillator import Oscillator
from ..oscillator.oscillator import leaves_of
from ..settings import check_noise, check_sampling
from ..show import Cell, Report, Reported, Style, Table, axis_label, engineering, figure, scaled, styled
from .plan import TAIL, plan, planned_motion

# Number of instants per run. The sum over them replaces that over all samples, to a few parts in ten thousand.
_INSTANTS = 1024
# Number of releases in the grid, and of evaluations of the criterion along the gradient.
_SPREAD, _EVALUATIONS = 24, 20
# Information of a negligible prior, in units of the values, so that the matrix has an inverse.
_NOTHING = 1e-9
# Rounding error of the information of an undetermined coefficient, as a fraction.
_ROUNDING = 1e-11


class Point(NamedTuple):
    """One run of a design.

    Attributes:
        x0: displacement at release [m]; `normal_force`: load [N].
        half_cycles: number of half-cycles until the stop; None if the mass does not stop.
        duration: length of the record [s].
        std_errors: relative standard errors of the targets after this run and all before it, by name.
        slopes: derivatives of the criterion with respect to the logarithms of release and load at this run.

    Examples:
        >>> from fricjax.sensitivity import Point
        >>> Point(1e-3, 9.66, 3, 0.17, {"mu": 1e-7}, (0.0, -1.0)).half_cycles
        3
    """

    x0: float
    normal_force: float
    half_cycles: int | None
    duration: float
    std_errors: dict[str, float]
    slopes: tuple[float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class OptimalRuns(Reported):
    """Optimal runs in order.

    Attributes:
        targets: wanted relative standard error of each coefficient, by name.
        criterion: "c" or "D".
        points: the runs.
        reached: True if all targets are met after the last run.
        samples: rate [1/s] and noise [m] of the runs.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> best = fj.sensitivity.optimal_runs(machine, (0.5e-3, 2e-3), {"mu": 1e-7}, ["mu", "damping", "stiffness"])
        >>> best.reached, best.points[0].half_cycles >= 5
        (True, True)
    """

    targets: dict[str, float]
    criterion: str
    points: tuple[Point, ...]
    reached: bool
    samples: tuple[float, float]

    @property
    def rate_for_targets(self) -> float:
        """Sampling rate for the targets, in white noise [1/s]."""
        last = self.points[-1].std_errors
        return self.samples[0] * max(last[name] / target for name, target in self.targets.items()) ** 2

    def report(self) -> Report:
        """Return the runs, with the standard errors after each."""
        rows = []
        for number, point in enumerate(self.points, 1):
            errors = {f"{name}_relative_std": point.std_errors[name] for name in self.targets}
            cells = [Cell(f"{error:.2g}", **{name: error}) for name, error in errors.items()]
            count = point.half_cycles
            place = [
                Cell(engineering(point.x0, "m", 4), x0=point.x0),
                Cell(engineering(point.normal_force, "N", 3), normal_force=point.normal_force),
                Cell("no stop", half_cycles=math.nan) if count is None else Cell(count, half_cycles=count),
            ]
            rows.append([number, *place, Cell(f"{point.duration:.3g} s", duration=point.duration), *cells])
        known = [f"then u({name})/{name}" for name in self.targets]
        heads = ["Run", "Release", "Load", "Half-cycles", "Record", *known]
        wanted = ", ".join(f"{name} to {target:.2g}" for name, target in self.targets.items())
        rate, noise = self.samples
        facts = [("wanted", wanted), ("criterion", f"{self.criterion}-optimal")]
        facts.append(("noise", f"white, {engineering(noise, 'm')} a sample at {rate:g} Hz"))
        enough = engineering(self.rate_for_targets, "Hz", 3)
        notes = [f"As long as the noise is white, these runs reach the targets from {enough} on."]
        short = "These runs do not reach the targets: allow more, a wider range or longer records, or sample faster."
        warnings = [] if self.reached else [short]
        data = {
            name: getattr(self, name) for name in ("targets", "criterion", "reached", "samples", "rate_for_targets")
        }
        data |= {"points": [point._asdict() for point in self.points]}
        table = Table(heads, rows, "Runs in order", {"x0": "m", "normal_force": "N", "duration": "s"})
        return Report([table], facts, notes, warnings, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw standard errors, targets, releases and loads of the runs, in matplotlib.

        Loads that are all equal are left out.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        places = {"Release": scaled([point.x0 for point in self.points], "m")}
        loads = [point.normal_force for point in self.points]
        if len(set(loads)) > 1:
            places["Load"] = scaled(loads, "N")
        drawing, grid = figure(1 + len(places), 1, share_x=True, heights=(4, *[2] * len(places)))
        top, *others = grid[:, 0]
        numbers = np.arange(1, len(self.points) + 1)
        for name, target in self.targets.items():
            (line,) = top.plot(numbers, [point.std_errors[name] for point in self.points], "o-", label=name)
            top.axhline(target, color=line.get_color(), linestyle="--", linewidth=0.8, label=f"wanted of {name}")
        top.set_yscale("log")
        top.set_ylabel("Relative standard error")
        for axis, (name, (values, unit)) in zip(others, places.items(), strict=True):
            axis.plot(numbers, values, "o")
            axis.set_ylabel(axis_label(name, unit))
        others[-1].set_xticks(numbers)
        others[-1].set_xlabel("Run")
        drawing.align_ylabels()
        drawing.legend(loc="outside upper center", ncols=2, fontsize=8)
        return styled(drawing, style)


def optimal_runs(
    oscillator: Oscillator,
    x0: tuple[float, float],
    targets: Mapping[str, float],
    names: Sequence[str],
    *,
    load: tuple[float, float] | None = None,
    criterion: str = "c",
    runs: int = 6,
    rate: float = 10e3,
    duration: float | None = None,
    noise: float = 1e-9,
) -> OptimalRuns:
    """Find the runs that reach targets, one after the other.

    Each run is the best addition to the runs before it.

    Args:
        oscillator: the machine at the expected values.
        x0: smallest and largest displacement at release [m].
        targets: wanted relative standard error of each coefficient, by name.
        names: coefficients to fit, including those of the targets.
        load: smallest and largest normal force [N]; None: that of the machine.
        criterion: "c" for the targets, "D" for all coefficients together.
        runs: largest number of runs.
        rate: samples per second.
        duration: longest record [s]; None: each until 50 ms after its stop.
        noise: standard deviation of the white noise of one sample [m].

    Returns:
        The runs, and the standard errors after each.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: ranges, targets, names or the duration are not valid, the criterion is unknown, or the mass never
            stops and there is no duration.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> fj.sensitivity.optimal_runs(machine, (0.5e-3, 2e-3), {"mu": 1e-7}, ["mu", "damping", "stiffness"]).reached
        True
    """
    leaves = leaves_of(oscillator)
    for name in names:
        find_leaf(name, leaves)
    _check(x0, targets, names, load, criterion, runs)
    check_noise(noise)
    check_sampling(rate, duration)
    space = _Space(oscillator, tuple(names), rate, math.inf if duration is None else duration, noise)
    wanted = np.array([targets.get(name, math.inf) for name in names])
    total, points = np.diag(np.full(len(names), _NOTHING)), []
    loads = (float(oscillator.normal_force),) * 2 if load is None else load
    while len(points) < runs:
        point, added = _best(space, total, wanted, criterion, x0, loads)
        total = total + added
        relative = dict(zip(names, np.sqrt(np.diag(np.linalg.inv(total))).tolist(), strict=True))
        points.append(point._replace(std_errors={name: relative[name] for name in targets}))
        if all(relative[name] <= target for name, target in targets.items()):
            break
    lost = [name for name, std in points[-1].std_errors.items() if not std < 1]
    if lost:
        raise UsageError(f"No release in this range determines {', '.join(lost)}. Release from farther away.")
    reached = all(points[-1].std_errors[name] <= target for name, target in targets.items())
    return OptimalRuns(dict(targets), criterion, tuple(points), reached, (rate, noise))


def _check(x0: Any, targets: Any, names: Any, load: Any, criterion: str, runs: int) -> None:
    for what, ends in (("x0", x0), ("load", load)):
        if ends is not None and not 0 < ends[0] < ends[1] < math.inf:
            raise UsageError(f"{what} must be a smaller and a larger positive number, got {ends[0]} and {ends[1]}.")
    if not targets or runs < 1:
        raise UsageError("A design needs at least one target and one run.")
    if criterion not in ("c", "D"):
        raise UsageError(f"There is no criterion {criterion!r}. Choose c, for the targets, or D, for all coefficients.")
    for name, target in targets.items():
        if name not in names:
            raise UsageError(f"{name} is not fitted.{nearest(name, names)} Fitted are {', '.join(names)}.")
        if not 0 < target < math.inf:
            raise UsageError(f"The target of {name} must be a positive relative standard error, got {target}.")


class _RunInformation(NamedTuple):
    """Information of one run about its coefficients.

    Attributes:
        matrix: information in units of the values, shape (p, p).
        slopes: its derivatives with respect to the logarithms of release and load, shape (p, p, 2).
        half_cycles, duration: see `Point`.
    """

    matrix: np.ndarray
    slopes: np.ndarray
    half_cycles: int | None
    duration: float


class _Space(NamedTuple):
    """Settings that all runs of a design share."""

    oscillator: Oscillator
    names: tuple[str, ...]
    rate: float
    longest: float
    noise: float

    def information(self, x0: float, load: float) -> _RunInformation:
        """Return the information of a run."""
        machine = eqx.tree_at(lambda each: each.normal_force, self.oscillator, np.asarray(load))
        motion = planned_motion(machine, x0)
        end = min(motion.t_stop + TAIL, self.longest)
        if not math.isfinite(end):
            raise UsageError("The mass never comes to rest here: say with the duration how long to record.")
        # Each instant replaces all samples up to the next one, so its noise is smaller.
        noise = self.noise / math.sqrt(self.rate * end / _INSTANTS)
        fixed = () if "normal_force" in self.names else ("normal_force",)
        planned = plan(
            machine, x0, np.linspace(0.0, end, _INSTANTS), [*self.names, *fixed], ("x0", "t_release", "offset"),
            noise=noise, motion=motion,
        )  # fmt: skip
        free = [i for i, name in enumerate(planned.names) if name not in fixed]
        moved = [planned.names.index("x0"), planned.names.index("normal_force")]
        value, slopes, alone = map(
            np.asarray, _information(planned.residual, np.array(free), np.array(moved), len(self.names))
        )
        # A direction that the nuisances absorb has only rounding errors. Set its information to zero.
        unit = np.sqrt(np.outer(alone, alone))
        sizes, vectors = np.linalg.eigh(value / unit)
        matrix = (vectors * np.where(sizes > _ROUNDING, sizes, 0.0)) @ vectors.T * unit
        return _RunInformation(matrix, slopes, motion.half_cycles, end)


@eqx.filter_jit
def _information(residual: Residual, free: Any, moved: Any, shared: int) -> Any:
    """Return the information about the coefficients, and its derivatives.

    The nuisances of the run are eliminated. The third result is the information with known nuisances.
    """
    run = residual.runs[0]

    def of(shift: Any) -> Any:
        at = jnp.zeros(residual.n_parameters).at[moved].add(shift)
        slopes = jax.jacfwd(lambda y: residual.observed(y, 0, run).read(run.t))(at)[:, free] * run.weight[:, None]
        normal = slopes.T @ slopes
        a, b, c = normal[:shared, :shared], normal[:shared, shared:], normal[shared:, shared:]
        unit = jnp.sqrt(jnp.diag(c))
        scaled_b = b / unit
        return a - scaled_b @ jnp.linalg.solve(c / jnp.outer(unit, unit), scaled_b.T), jnp.diag(a)

    nothing = jnp.zeros(2)
    value, alone = of(nothing)
    return value, jax.jacfwd(lambda shift: of(shift)[0])(nothing), alone


def criterion_of(total: np.ndarray, wanted: np.ndarray, criterion: str) -> tuple[float, np.ndarray]:
    """Return the criterion of an information matrix and its derivative.

    Args:
        total: information in units of the values, shape (p, p).
        wanted: wanted relative standard error of each coefficient, inf without a target, shape (p,).
        criterion: "c" or "D".

    Examples:
        >>> import numpy as np
        >>> value, slope = criterion_of(np.diag([4.0, 1.0]), np.array([0.5, np.inf]), "c")
        >>> float(value), slope.tolist()
        (0.0, [[-0.25, 0.0], [0.0, 0.0]])
    """
    inverse = np.linalg.inv(total)
    if np.linalg.slogdet(total)[0] <= 0 or np.any(np.diag(inverse) <= 0):
        # A direction that no run determines has only rounding errors, of either sign.
        return math.inf, np.zeros_like(total)
    if criterion == "D":
        return -float(np.linalg.slogdet(total)[1]), -inverse
    parts = np.diag(inverse) / wanted**2
    square = float(parts.sum())
    return math.log(square), -(inverse * (1 / wanted**2)) @ inverse / square


def _best(
    space: _Space, total: np.ndarray, wanted: np.ndarray, criterion: str, x0: Any, loads: Any
) -> tuple[Point, np.ndarray]:
    """Return the run with the smallest criterion, and its information."""
    from scipy.optimize import minimize

    def at(where: np.ndarray) -> tuple[float, np.ndarray, _RunInformation]:
        run = space.information(*np.exp(where))
        value, by_matrix = criterion_of(total + run.matrix, wanted, criterion)
        return value, np.einsum("ij,ijk->k", by_matrix, run.slopes), run

    ends = np.log(np.array([x0, loads], float))
    places = np.linspace(ends[0, 0], ends[0, 1], _SPREAD)
    starts = [np.array([place, load]) for place in places for load in np.unique(ends[1])]
    start, (least, _, first) = min(((where, at(where)) for where in starts), key=lambda each: each[1][0])
    if not math.isfinite(least):
        raise UsageError("No release in this range determines these coefficients. Release from farther away.")

    def within(where: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope, run = at(where)
        # Exclude motions with another number of half-cycles.
        return (value, slope) if run.half_cycles == first.half_cycles else (value + 1e3, slope)

    moved: Any = minimize(
        within, start, jac=True, bounds=ends.tolist(), method="L-BFGS-B", options={"maxfun": _EVALUATIONS}
    )
    where = moved.x if moved.fun <= least else start
    _, slope, run = at(where)
    release, load = np.clip(np.exp(where), [x0[0], loads[0]], [x0[1], loads[1]])
    slopes = float(slope[0]), float(slope[1])
    return Point(float(release), float(load), run.half_cycles, run.duration, {}, slopes), run.matrix
