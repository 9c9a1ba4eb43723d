"""Profile likelihoods: chi^2 with a parameter fixed and all others fitted again.

If chi^2 is a parabola about the optimum, it crosses ``chi^2_min + 3.84`` at 1.96 standard errors. Otherwise the
interval between the crossings is the right one. Without a crossing the record does not bound the parameter on that
side (Raue et al., Bioinformatics 25, 1923, 2009). For coloured noise chi^2 is scaled such that its curvature at the
optimum agrees with the standard error of the fit.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import UsageError, nearest
from ..estimation.covariance import LIKELIHOOD_DROP
from ..estimation.space import LINEAR
from ..fitting import Fit
from ..fitting.problem import Problem
from ..fitting.solve import Solution
from ..oscillator import one_blas_thread
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, interval, scaled, styled, uncertain
from ..show.thumbnail import Curve, curves_svg
from ..show.working import working
from .again import fixed_at, optimum, problem_of, squares

BOUNDED, ONE_SIDED, FLAT, MULTIMODAL = "bounded", "one-sided", "flat", "multimodal"
# Width of the prior that fixes a value, in units of its step on the profile. The equations stay well conditioned.
_HELD = 1e-3
# Number of extensions of a profile without a crossing; each doubles its length.
_ROUNDS = 6
# Least height of a ridge between two valleys, in chi^2: the rise at one standard error.
_RIDGE = 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class Profile(Reported):
    """The profile of a parameter.

    Attributes:
        name, unit: name and unit of the parameter.
        value, std_error: fitted value and its standard error.
        at: fixed values in ascending order, shape (n,).
        excess: twice the logarithm of the likelihood at the optimum over that at each value, shape (n,).
        others: values of all parameters along the profile, by name, shape (n,) each.
        std_errors: standard errors of all parameters in the fit, by name.
        interval: crossings of `excess` with 3.84; a bound or inf on a side without a crossing.
        conclusion: "bounded", "one-sided", "flat" or "multimodal".

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> profile = fj.uncertainty.profile(fit, "mu")
        >>> low, high = profile.interval
        >>> profile.conclusion, round((high - low) / (2 * 1.96 * fit.std_errors["mu"]), 2)
        ('bounded', 1.0)
    """

    name: str
    unit: str
    value: float
    std_error: float
    at: np.ndarray
    excess: np.ndarray
    others: dict[str, np.ndarray]
    std_errors: dict[str, float]
    interval: tuple[float, float]
    conclusion: str

    def report(self) -> Report:
        """Return the intervals of the profile and of the standard error."""
        reach = np.sqrt(LIKELIHOOD_DROP) * self.std_error
        ends = {"profile": self.interval, "standard error": (self.value - reach, self.value + reach)}
        fitted = {"value": self.value, "std": self.std_error}
        rows = [
            [by, Cell(interval(low, high), low=low, high=high, **fitted), self.unit] for by, (low, high) in ends.items()
        ]
        sentences = {
            BOUNDED: "The record bounds it on both sides.",
            ONE_SIDED: "The record bounds it on one side only.",
            FLAT: "The record does not bound it: other parameters make up for any of its values.",
            MULTIMODAL: "There is more than one valley; the interval holds them all.",
        }
        facts = [(self.name, uncertain(self.value, self.std_error, self.unit)), ("profile", self.conclusion)]
        table = Table(["By", "95 % interval", "Unit"], rows, f"Profile of {self.name}")
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return Report([table], facts, [sentences[self.conclusion]], data=data)

    def thumbnails(self) -> Sequence[str]:
        near = self.excess < 4 * LIKELIHOOD_DROP
        curve = Curve(self.at[near], self.excess[near])
        return [curves_svg([curve], (self.name, self.unit), ("Excess of chi^2", ""))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the profile, its parabola and the other parameters, in matplotlib.

        The axes are in units of the standard errors, if there are any, because the values differ only in their last
        digits.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(2, share_x=True)
        upper, lower = axes[:, 0]
        near = self.excess < 4 * LIKELIHOOD_DROP
        if np.isfinite(self.std_error) and self.std_error > 0:
            at = (self.at - self.value) / self.std_error
            label = f"{self.name}, in standard errors from {uncertain(self.value, self.std_error, self.unit)}"
            shown = near & (at**2 < 4 * LIKELIHOOD_DROP)
            upper.plot(at[shown], at[shown] ** 2, "--", color="#D55E00", label="standard error", zorder=3)
        else:
            at, unit = scaled(self.at, self.unit)
            label = axis_label(self.name, unit)
        upper.plot(at[near], self.excess[near], "o-", color="#0072B2", markersize=3, label="profile")
        upper.axhline(LIKELIHOOD_DROP, color="#000000", linewidth=0.8)
        upper.set_ylabel("Excess of chi^2")
        upper.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
        best = int(np.argmin(self.excess))
        for name, values in self.others.items():
            size = self.std_errors[name] if np.isfinite(self.std_errors[name]) else np.ptp(values[near])
            if name != self.name and size > 0:
                lower.plot(at[near], (values[near] - values[best]) / size, label=name)
        lower.set_ylabel("Others [standard errors]")
        lower.set_xlabel(label)
        lower.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
        drawing.align_ylabels()
        return styled(drawing, style)

    def __repr__(self) -> str:
        return f"Profile({self.name}: {self.conclusion}, {interval(*self.interval, self.unit)})"


@working("Profiling")
@one_blas_thread()
def profile(fit: Fit, name: str, *, points: int = 16, reach: float = 3.0) -> Profile:
    """Fit with one parameter fixed at values about its optimum.

    Args:
        fit: the fit; not one that was read from a file.
        name: a free parameter.
        points: number of values on each side.
        reach: distance of the outermost values in standard errors. If chi^2 has not risen by 3.84 there, the profile
            continues, each time to twice the distance.

    Returns:
        The profile, its 95 % interval, and the conclusion.

    Raises:
        UsageError: the name is not free, or the fit has no optimum or is from a file.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fj.uncertainty.profile(fit, "damping", points=4).conclusion
        'bounded'
    """
    problem = problem_of(fit)
    if name not in fit.names:
        raise UsageError(
            f"{name!r} is not free in this fit.{nearest(name, fit.names)} Free are {', '.join(fit.names)}."
        )
    space, i = problem.residual.space, fit.names.index(name)
    fitted = optimum(fit)
    slope = abs(float(np.asarray(space.slope(space.coordinates(fitted)))[i]))
    (least,) = squares([problem], [space.coordinates(fitted)])
    variance, std = least.shape.inverse[i, i], fit.std_errors[name] / slope
    bounded = np.isfinite(std) and std > 0 and variance > 0
    # Without a standard error chi^2 is not scaled, and a step is a tenth of the scale of the value.
    unit, step = (variance / std**2, std) if bounded else (1 / max(fit.chi2_reduced, 1.0), 0.1)
    along = least.shape.inverse[:, i] / variance if variance > 0 else np.zeros(len(fitted))
    along[i] = 1.0
    solutions = {0.0: least}
    reached, wanted = {-1.0: reach, 1.0: reach}, np.outer([-1, 1], np.linspace(reach / points, reach, points)).ravel()
    for _ in range(_ROUNDS):
        solutions |= _fixed_at(problem, solutions, i, along, step * wanted)
        shifts = np.array(sorted(solutions))
        rise = np.array([unit * solutions[shift].chi2 for shift in shifts])
        rise -= rise.min()
        open_ends = [side for side in reached if not np.any(rise[shifts * side > 0] > LIKELIHOOD_DROP)]
        if not open_ends:
            break
        wanted = np.concatenate([side * np.linspace(1, 2, points + 1)[1:] * reached[side] for side in open_ends])
        reached |= {side: 2 * reached[side] for side in open_ends}
    values = np.array([np.asarray(solutions[s].derived.values) for s in shifts]) + problem.origins
    # With coloured noise the fit is not at the least-squares optimum. Keep the distances from the optimum.
    at = values[:, i] + fit.values[name] - values[shifts == 0, i]
    ends, conclusion = conclude(at, rise)
    parameter = problem.parameters[i]
    # A parameter fitted as a logarithm is never negative.
    lowest = parameter.lower if parameter.kind in LINEAR else max(parameter.lower, 0.0)
    ends = (max(ends[0], lowest), min(ends[1], parameter.upper))
    others = dict(zip(fit.names, values.T, strict=True))
    errors = dict(fit.std_errors)
    return Profile(name, fit.units[name], fit.values[name], errors[name], at, rise, others, errors, ends, conclusion)


def _fixed_at(
    problem: Problem, solutions: dict[float, Solution], i: int, along: np.ndarray, shifts: np.ndarray
) -> dict[float, Solution]:
    """Return solutions with parameter `i` fixed, by its distance from the optimum.

    Distances beyond the bounds are left out. Each solution starts from the nearest known one, because far from the
    optimum the other parameters do not follow a straight line.
    """
    limits, space, p = problem.limits, problem.residual.space, len(along)
    middle = solutions[0.0].y[i]
    within = [float(shift) for shift in shifts if limits.lower[i] < middle + shift < limits.upper[i]]
    nearest_ones = [min(solutions, key=lambda known: abs(known - shift)) for shift in within]
    starts = [solutions[near].y[:p] + (shift - near) * along for near, shift in zip(nearest_ones, within, strict=True)]
    begins = [np.clip(start, limits.lower, limits.upper) for start in starts]
    problems = []
    for begin, shift in zip(begins, within, strict=True):
        begin[i] = middle + shift
        width = _HELD * abs(shift * float(np.asarray(space.slope(begin))[i]))
        problems.append(fixed_at(problem, i, float(np.asarray(space.values(begin))[i]), width))
    further = zip(within, squares(problems, begins), strict=True)
    return {shift: each for shift, each in further if each.converged and np.isfinite(each.chi2)}


def conclude(at: np.ndarray, rise: np.ndarray) -> tuple[tuple[float, float], str]:
    """Return the interval with a rise below the threshold, and the conclusion."""
    order = np.argsort(at)
    at, rise = at[order], rise[order]
    inside = np.flatnonzero(rise <= LIKELIHOOD_DROP)
    first, last = inside[0], inside[-1]
    ends = [-np.inf, np.inf]
    # The root of chi^2 is nearly a straight line at the crossing.
    root, level = np.sqrt(rise), np.sqrt(LIKELIHOOD_DROP)
    if first > 0:
        ends[0] = float(np.interp(-level, -root[[first - 1, first]], at[[first - 1, first]]))
    if last < at.size - 1:
        ends[1] = float(np.interp(level, root[[last, last + 1]], at[[last, last + 1]]))
    least = int(np.argmin(rise))
    valleys = [
        k
        for k in inside
        if k not in (0, least, at.size - 1)
        and rise[k] < min(rise[k - 1], rise[k + 1])
        and rise[min(k, least) : max(k, least)].max() > rise[k] + _RIDGE
    ]
    open_ends = sum(map(bool, np.isinf(ends)))
    conclusion = MULTIMODAL if valleys and not open_ends else (BOUNDED, ONE_SIDED, FLAT)[open_ends]
    return (ends[0], ends[1]), conclusion
