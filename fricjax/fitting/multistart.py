"""Fit from many start values, and keep the best fit.

Least squares finds the optimum of the valley in which it starts. For example, the ringing of a contact causes one
valley for every cycle by which its frequency may be off. So the fit starts from points around the automatic start. The
sums of squares at which the starts end, in ascending order, form a waterfall plot: a long flat step at its foot means
that most starts found the same optimum.

The starts are solved one after the other by one compiled program. In a vectorised program all would wait for the one
with the most steps.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence
from numbers import Real
from typing import Any, NamedTuple, Unpack

import numpy as np

from ..errors import UsageError, check_type
from ..estimation.space import Parameter
from ..oscillator import Oscillator, one_blas_thread, ready
from ..show import Report, Reported, Style, figure, plain, styled
from ..show.tables import dataframe
from ..show.thumbnail import Curve, curves_svg
from ..show.working import working
from .fit import concluded, records_of
from .parameters import Request, Settings, check_known
from .problem import Problem, problem_on, windows_of
from .rest import solve_with_rest
from .result import Fit
from .solve import solve_condensed, start_coordinates

# Spread of a logarithmic start value, as a part of that of `spread`: the decay determines these much better.
_SPREAD = {"mass": 2e-3, "stiffness": 2e-3, "mu": 0.05, "normal_force": 0.05, "mu_s": 0.1, "damping": 0.2, "drag": 0.2}
# Largest difference of chi^2, in units of its reduced value, between fits at the same optimum.
_SAME = 4.0


@dataclasses.dataclass(frozen=True, eq=False)
class Multistart(Reported):
    """Fits of one record from many starts, in order of chi^2.

    Attributes:
        best: the fit from the best start, complete with uncertainties.
        excess: chi^2 of each start minus that of the best one, shape (starts,); inf if the model failed.
        starts: start values of each coefficient by name, shape (starts,), in the same order.
        ends: values at which each start ended, likewise.
        automatic: index of the automatic start in this order.
        at_bounds: names of the parameters that ended at a bound, for each start.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> found = fj.multistart(run, machine, ["mu", "damping", "stiffness"], starts=3)
        >>> found.starts["mu"].shape, found.ends["mu"].shape
        ((3,), (3,))
    """

    best: Fit
    excess: np.ndarray
    starts: dict[str, np.ndarray]
    ends: dict[str, np.ndarray]
    automatic: int
    at_bounds: tuple[tuple[str, ...], ...]

    @property
    def reached(self) -> np.ndarray:
        """True for starts that ended in the best optimum, shape (starts,)."""
        return self.excess <= _SAME * max(self.best.chi2_reduced, 1.0)

    @property
    def share(self) -> float:
        """Fraction of the starts that ended in the best optimum."""
        return float(np.mean(self.reached))

    def report(self) -> Report:
        """Report the best fit, and how many starts reached it."""
        report, total, reached = self.best.report(), self.excess.size, int(self.reached.sum())
        where = "the automatic start is one of them"
        if not self.reached[self.automatic]:
            where = f"the automatic start ended at a chi^2 larger by {plain(float(self.excess[self.automatic]), 3)}"
        facts = [*report.facts, ("starts", f"{reached} of {total} reached this optimum; {where}")]
        others = self.excess[~self.reached & np.isfinite(self.excess)]
        if others.size:
            facts.append(("next optimum", f"chi^2 larger by {plain(float(others[0]), 3)}"))
        at_bound = Counter(name for names in self.at_bounds for name in names)
        if at_bound:
            counts = (f"{name} in {count} of {total} starts" for name, count in at_bound.items())
            facts.append(("bounds", ", ".join(counts)))
        return dataclasses.replace(report, facts=facts)

    def to_dataframe(self) -> Any:
        """Return one row per start, in ascending order of chi^2.

        A coefficient has its start value in `<name>_start` and its fitted value in `<name>`.
        """
        columns: dict[str, Any] = {"excess": self.excess, "reached": self.reached}
        for name, ends in self.ends.items():
            columns |= {f"{name}_start": self.starts[name], name: ends}
        columns["at_bounds"] = [", ".join(names) for names in self.at_bounds]
        units = {f"{name}{end}": self.best.units[name] for name in self.ends for end in ("_start", "")}
        return dataframe(columns, units).rename_axis("start")

    def thumbnails(self) -> Sequence[str]:
        reduced = (self.best.chi2 + self.excess) / self.best.dof
        starts = Curve(np.arange(1, self.excess.size + 1), reduced, points=True)
        return [
            *self.best.thumbnails(),
            curves_svg([starts], ("Start, in order of its fit", ""), ("Reduced chi^2", "")),
        ]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the waterfall: reduced chi^2 of all starts in ascending order.

        The automatic start has a square marker.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, grid = figure()
        axes = grid[0, 0]
        rank = np.arange(1, self.excess.size + 1)
        reduced = (self.best.chi2 + self.excess) / self.best.dof
        shown, first = np.where(np.isfinite(reduced), reduced, np.nan), self.automatic
        axes.plot(rank, shown, marker="o", markersize=4)
        axes.plot(rank[first], shown[first], marker="s", markersize=7, fillstyle="none", linestyle="")
        if np.nanmax(shown) > 2 * np.nanmin(shown):
            axes.set_yscale("log")
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set_xlabel("Start, in order of its fit")
        axes.set_ylabel("Reduced $\\chi^2$")
        axes.set_title(
            f"{int(self.reached.sum())} of {self.excess.size} starts reach the best optimum; square: automatic start",
            fontsize=9,
            loc="left",
        )
        return styled(drawing, style)

    def __repr__(self) -> str:
        return f"Multistart({int(self.reached.sum())} of {self.excess.size} starts reached {self.best!r})"


@one_blas_thread()
def multistart(
    data: object,
    oscillator: Oscillator,
    free: Sequence[str],
    *,
    starts: int = 16,
    spread: float = 10.0,
    seed: int = 0,
    **settings: Unpack[Settings],
) -> Multistart:
    """Fit from many start values, and keep the best fit.

    Args:
        data: a run, or a list of runs for a joint fit, as for :func:`fit`.
        oscillator: the machine and its friction law.
        free: names of the coefficients to fit.
        starts: number of starts; the first is the automatic one, the others are a Latin hypercube around it.
        spread: factor by which coefficients of the law are spread in both directions. Those that the decay determines
            (mu, damping, stiffness) are spread less. A coefficient with two finite bounds is spread over their whole
            range.
        seed: seed of the Latin hypercube.
        settings: settings of :func:`fit`, by name.

    Returns:
        The best fit and the waterfall of all starts.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings that do not fit.
        DataError: a record that cannot be fitted.
        FitError: the best fit is not valid, unless `throw=False` is among the settings.

    ```python
    fricjax.multistart("run.csv", oscillator, ["mu", "damping", "stiffness"], starts=8).best
    ```

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> round(fj.multistart(run, machine, ["mu", "damping", "stiffness"], starts=3).best.values["mu"], 6)
        0.05
    """
    ready()
    check_type("starts", starts, int | np.integer, "a number of starts")
    check_type("spread", spread, Real, "a number above 1")
    if starts < 1 or not spread > 1:
        raise UsageError(f"multistart needs at least one start and a spread above 1, got {starts} and {spread:g}.")
    check_known("multistart", settings, [*Settings.__annotations__, "starts", "spread", "seed"])
    sigma_mode, throw = settings.get("sigma_mode", "absolute"), settings.get("throw", True)
    request = Request.of(oscillator, free, **settings)
    windows = windows_of(records_of(data, settings.get("t"), settings.get("rate"), sigma_mode), request)
    first = problem_on(windows, request)
    points = _points(first, starts, spread, seed)
    problems = [first, *(problem_on(windows, request.with_guess({**request.guess, **at})) for at in points)]
    ends = []
    with working("Fitting from many starts", len(problems)) as task:
        for each in problems:
            ends.append(_ended(each, start_coordinates(each)))
            task.advance()
        order = np.argsort([end.cost for end in ends], kind="stable")
        problem, solution = solve_with_rest(problems[order[0]], ends[order[0]].y)
        best = concluded(problem, solution, sigma_mode, throw)
    return _ordered(best, problems, ends, order)


class _Ended(NamedTuple):
    """Coordinates and values, shape (p,), and loss where a start ended.

    The loss is inf if the model failed.
    """

    y: np.ndarray
    values: np.ndarray
    cost: float


def _ended(problem: Problem, begin: np.ndarray) -> _Ended:
    try:
        at = solve_condensed(problem, begin)
    except UsageError:
        # The motion from there needs more steps than a mesh holds.
        return _Ended(begin, np.full(begin.size, np.nan), np.inf)
    cost = 2 * float(at.evaluation.cost)
    return _Ended(np.asarray(at.y), np.asarray(at.derived.values), cost if np.isfinite(cost) else np.inf)


def _points(problem: Problem, starts: int, spread: float, seed: int) -> list[dict[str, float]]:
    """Return start values of the shared parameters, from a Latin hypercube."""
    from scipy.stats import qmc

    shared = problem.parameters[: len(problem.residual.space.leaves)]
    if starts == 1:
        return []
    cube = qmc.LatinHypercube(len(shared), rng=np.random.default_rng(seed)).random(starts - 1)
    return [{p.name: _start(p, float(u), spread) for p, u in zip(shared, row, strict=True)} for row in cube]


def _start(parameter: Parameter, u: float, spread: float) -> float:
    """Return a start value for a random number between 0 and 1."""
    if np.isfinite(parameter.lower) and np.isfinite(parameter.upper):
        return parameter.lower + u * (parameter.upper - parameter.lower)
    factor = spread ** (_SPREAD.get(parameter.kind, 1.0) * (2 * u - 1))
    return float(np.clip((parameter.start or parameter.scale) * factor, parameter.lower, parameter.upper))


def _ordered(best: Fit, problems: Sequence[Problem], ends: Sequence[_Ended], order: np.ndarray) -> Multistart:
    costs = np.array([ends[i].cost for i in order])
    names = problems[0].names
    starts = np.array([[p.start for p in problems[i].parameters] for i in order])
    values = np.array([ends[i].values for i in order])
    at_bounds = tuple(
        tuple(name for name, low, high, y in zip(names, limits.lower, limits.upper, ends[i].y, strict=True)
              if y <= low or y >= high)
        for i, limits in ((i, problems[i].limits) for i in order)
    )  # fmt: skip
    return Multistart(
        best=best,
        excess=np.where(np.isfinite(costs), costs - costs[0], np.inf),
        starts=dict(zip(names, starts.T, strict=True)),
        ends=dict(zip(names, values.T, strict=True)),
        automatic=int(np.flatnonzero(order == 0)[0]),
        at_bounds=at_bounds,
    )
