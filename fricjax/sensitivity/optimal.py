"""Which runs to make: releases and loads moved along the slope of an optimal design's criterion.

The information of runs adds up once the parameters of each run alone are eliminated from it. The criterion is minus the
logarithm of its determinant (D-optimal), or the logarithm of the largest part of a target that is left as uncertainty
(c-optimal; Fedorov, Theory of Optimal Experiments, 1972; Pukelsheim, Optimal Design of Experiments, 2006). It is
smooth in the release and the load as long as the number of half-cycles stays, and jumps where that changes: so one run
after the other is chosen among releases spread over the range and is then moved along the slope within its segment of
the map.
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
from ..show import Report, Reported, Style, Table, axis_label, engineering, figure, scaled, styled
from .plan import TAIL, plan, planned_motion

# Instants at which a run is looked at: a sum over its samples is an integral, to parts in ten thousand.
_INSTANTS = 1024
# Releases that are looked at, and evaluations of the criterion in which a run is moved along its slope.
_SPREAD, _EVALUATIONS = 24, 20
# What a prior of no weight adds to the information in units of the values, so that it can be inverted.
_NOTHING = 1e-9
# Part of its own information that rounding leaves of a coefficient which is not determined.
_ROUNDING = 1e-11


class Point(NamedTuple):
    """One run of a design.

    Attributes:
        x0: displacement at release [m]; `normal_force`: load [N].
        half_cycles: until it stops; None where it does not stop by itself. `duration`: of the record [s].
        std_errors: relative standard errors of the targets after this run and those before it, by name.
        slopes: of the criterion by the logarithm of the release and of the load, where the run was left.

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
    """Runs in the order in which to make them.

    Attributes:
        targets: wanted relative standard error of each coefficient, by name.
        criterion: "c" or "D".
        points: the runs.
        reached: whether all targets are met after the last.
        samples: rate and noise of the runs [1/s], [m].

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
        """At which these runs reach the targets, as long as the noise of neighbouring samples is white [1/s]."""
        last = self.points[-1].std_errors
        return self.samples[0] * max(last[name] / target for name, target in self.targets.items()) ** 2

    def report(self) -> Report:
        """The runs, and what is known after each."""
        rows = []
        for number, point in enumerate(self.points, 1):
            cells = [f"{point.std_errors[name]:.2g}" for name in self.targets]
            count = "no stop" if point.half_cycles is None else point.half_cycles
            place = [engineering(point.x0, "m", 4), engineering(point.normal_force, "N", 3), count]
            rows.append([number, *place, f"{point.duration:.3g} s", *cells])
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
        return Report([Table(heads, rows, "Runs in order")], facts, notes, warnings, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Relative standard errors after each run with their targets, releases, and loads that differ; in matplotlib.

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
    """Runs that reach targets with the fewest of them, each chosen for what the runs before it leave open.

    Args:
        oscillator: the machine at the values that are expected.
        x0: smallest and largest displacement that the rig can release from [m].
        targets: relative standard error that is wanted of each coefficient, by name.
        names: coefficients to be fitted, those of the targets among them.
        load: smallest and largest normal force that runs may have [N]; None: that of the machine.
        criterion: "c" for the targets, "D" for all coefficients together.
        runs: most runs that there may be.
        rate: samples per second.
        duration: longest record that there may be [s]; None: each until 50 ms after its stop.
        noise: standard deviation of the white noise of one sample [m].

    Returns:
        The runs, and the standard errors after each.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: ranges, targets, names or a duration that are none, an unknown criterion, or without a duration a
            mass that never stops.

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
        matrix: in units of their values, shape (p, p); `slopes`: its derivatives by the logarithms of release and
            load, shape (p, p, 2).
        half_cycles, duration: as of a `Point`.
    """

    matrix: np.ndarray
    slopes: np.ndarray
    half_cycles: int | None
    duration: float


class _Space(NamedTuple):
    """What all runs of a design have in common."""

    oscillator: Oscillator
    names: tuple[str, ...]
    rate: float
    longest: float
    noise: float

    def information(self, x0: float, load: float) -> _RunInformation:
        """The information of a run."""
        machine = eqx.tree_at(lambda each: each.normal_force, self.oscillator, np.asarray(load))
        motion = planned_motion(machine, x0)
        end = min(motion.t_stop + TAIL, self.longest)
        if not math.isfinite(end):
            raise UsageError("The mass does not come to rest by itself here: say with the duration how long to record.")
        # Samples stand for so many of the run as lie between two of them.
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
        # Of what the parameters of the run take away altogether rounding is left, which would count as knowledge.
        unit = np.sqrt(np.outer(alone, alone))
        sizes, vectors = np.linalg.eigh(value / unit)
        matrix = (vectors * np.where(sizes > _ROUNDING, sizes, 0.0)) @ vectors.T * unit
        return _RunInformation(matrix, slopes, motion.half_cycles, end)


@eqx.filter_jit
def _information(residual: Residual, free: Any, moved: Any, shared: int) -> Any:
    """Information about the shared coefficients, those of the run eliminated, and its derivatives."""
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
    """The criterion of an information matrix in units of the values, and its derivative by that matrix.

    Args:
        total: shape (p, p).
        wanted: relative standard error that is wanted of each coefficient, inf where none is, shape (p,).
        criterion: "c" or "D".

    Examples:
        >>> import numpy as np
        >>> value, slope = criterion_of(np.diag([4.0, 1.0]), np.array([0.5, np.inf]), "c")
        >>> float(value), slope.tolist()
        (0.0, [[-0.25, 0.0], [0.0, 0.0]])
    """
    inverse = np.linalg.inv(total)
    if np.linalg.slogdet(total)[0] <= 0 or np.any(np.diag(inverse) <= 0):
        # Of a direction that no run determines rounding is left, of either sign.
        return math.inf, np.zeros_like(total)
    if criterion == "D":
        return -float(np.linalg.slogdet(total)[1]), -inverse
    parts = np.diag(inverse) / wanted**2
    square = float(parts.sum())
    return math.log(square), -(inverse * (1 / wanted**2)) @ inverse / square


def _best(
    space: _Space, total: np.ndarray, wanted: np.ndarray, criterion: str, x0: Any, loads: Any
) -> tuple[Point, np.ndarray]:
    """The run that makes the criterion the least, with its information."""
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
        # Behind an edge of the map the motion is another one.
        return (value, slope) if run.half_cycles == first.half_cycles else (value + 1e3, slope)

    moved: Any = minimize(
        within, start, jac=True, bounds=ends.tolist(), method="L-BFGS-B", options={"maxfun": _EVALUATIONS}
    )
    where = moved.x if moved.fun <= least else start
    _, slope, run = at(where)
    release, load = np.clip(np.exp(where), [x0[0], loads[0]], [x0[1], loads[1]])
    slopes = float(slope[0]), float(slope[1])
    return Point(float(release), float(load), run.half_cycles, run.duration, {}, slopes), run.matrix
