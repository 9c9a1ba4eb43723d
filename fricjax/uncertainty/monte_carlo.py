"""Propagation of distributions by Monte Carlo (JCGM 101:2008)."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import UsageError
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, styled, uncertain
from ..show.thumbnail import Curve, curves_svg
from ..show.working import working
from .inputs import Input

# Number of draws per block: 10 inputs take 8 MB.
_BLOCK = 100_000
# Number of parts of the draws, to estimate the standard error of the ends of the interval.
_PARTS = 20
# JCGM 101, 7.9.2: the tolerance is half a unit of the second significant digit of the standard uncertainty.
_DIGITS = 2
_BINS = 80  # of the histogram in the thumbnail


@dataclasses.dataclass(frozen=True, eq=False)
class MonteCarlo(Reported):
    """The distribution of a result from draws, and its budget.

    Attributes:
        draws: number of draws.
        mean, std: mean and standard deviation of the results.
        interval: probabilistically symmetric interval.
        shortest: shortest interval of the same probability.
        level: probability of the intervals.
        value, budget_std, budget_interval: result of the budget, its standard uncertainty and its interval.
        tolerance: half a unit of the second significant digit of the standard uncertainty.
        difference: largest distance between an end of `interval` and the same end of `budget_interval`.
        spread: standard error of the ends of `interval`, from parts of the draws.
        sample: the results in order, shape (draws,).

    Examples:
        >>> from fricjax.uncertainty import Input, propagate
        >>> ratio = propagate(lambda a, b: a / b, {"a": Input(1.0, 0.01), "b": Input(1.0, 0.2)}, quantity="ratio")
        >>> check = ratio.monte_carlo(100_000)
        >>> check.agrees, check.interval[1] > 1.6 > check.budget_interval[1]
        (False, True)
    """

    draws: int
    mean: float
    std: float
    interval: tuple[float, float]
    shortest: tuple[float, float]
    level: float
    value: float
    budget_std: float
    budget_interval: tuple[float, float]
    tolerance: float
    difference: float
    spread: float
    sample: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, value: float, std: float, half_width: float, level: float) -> "MonteCarlo":
        """Compare drawn results with a budget.

        Args:
            values: the results, shape (draws,).
            value: result of the budget.
            std: its standard uncertainty.
            half_width: its expanded uncertainty.
            level: coverage probability.

        Raises:
            UsageError: there are too few draws for the intervals, or a result is not finite.
        """
        # A quantile needs ten draws beyond each end in each part.
        if values.size * (1 - level) / 2 < 10 * _PARTS:
            raise UsageError(
                f"{values.size} draws are too few for intervals of {100 * level:g} %: take "
                f"{math.ceil(20 * _PARTS / (1 - level))} at least."
            )
        if not np.all(np.isfinite(values)):
            lost = int(np.sum(~np.isfinite(values)))
            raise UsageError(
                f"The formula has no finite result in {lost} of {values.size} draws: an input reaches values that it "
                "cannot have. Give that input a bounded distribution."
            )
        ends = np.array([(1 - level) / 2, (1 + level) / 2])
        low, high = np.quantile(values, ends)
        parts = np.quantile(values[: values.size // _PARTS * _PARTS].reshape(_PARTS, -1), ends, axis=1)
        budget = (value - half_width, value + half_width)
        ordered = np.sort(values)
        return cls(
            draws=values.size,
            mean=float(values.mean()),
            std=float(values.std(ddof=1)),
            interval=(float(low), float(high)),
            shortest=_shortest(ordered, level),
            level=level,
            value=value,
            budget_std=std,
            budget_interval=budget,
            tolerance=_tolerance(std),
            difference=float(max(abs(low - budget[0]), abs(high - budget[1]))),
            spread=float(np.max(parts.std(axis=1, ddof=1)) / math.sqrt(_PARTS)),
            sample=ordered,
        )

    @property
    def agrees(self) -> bool:
        """True if both intervals agree within the tolerance (8.1)."""
        return self.difference <= self.tolerance

    @property
    def stable(self) -> bool:
        """True if the ends are stable within tolerance/5 (8.2)."""
        return self.spread <= self.tolerance / 5

    def report(self) -> Report:
        """Return both intervals and their comparison."""
        level = f"{100 * self.level:g} %"
        # The tolerance determines the number of digits.
        digits = max(-math.floor(math.log10(self.tolerance)), 0) if self.tolerance else 6
        value = lambda value, std: Cell(uncertain(value, std), value=value, std=std)
        ends = lambda low, high: Cell(f"[{low:.{digits}f}, {high:.{digits}f}]", low=low, high=high)
        rows = [
            ["Monte Carlo", value(self.mean, self.std), ends(*self.interval)],
            ["Monte Carlo, shortest", None, ends(*self.shortest)],
            ["budget", value(self.value, self.budget_std), ends(*self.budget_interval)],
        ]
        apart = f"the ends of the intervals differ by {self.difference:.2g}"
        tolerated = f"{self.tolerance:.1g}, half of the last of two digits of the uncertainty (JCGM 101, 8)"
        if self.agrees:
            notes = [f"The budget is validated: {apart}, no more than {tolerated}."]
        else:
            notes = [f"The budget to first order is not enough: {apart}, more than {tolerated}. Use Monte Carlo's."]
        warnings = []
        if not self.stable:
            warnings.append(f"{self.draws} draws leave the ends uncertain by {self.spread:.2g}: take more.")
        table = Table(["By", "Mean and standard uncertainty", f"{level} interval"], rows, f"{self.draws} draws")
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "sample"}
        data |= {"agrees": self.agrees, "stable": self.stable}
        return Report([table], notes=notes, warnings=warnings, data=data)

    def thumbnails(self) -> Sequence[str]:
        density, edges = np.histogram(self.sample, bins=_BINS, density=True)
        middle = (edges[1:] + edges[:-1]) / 2
        curves = [Curve(middle, density, broad=True), Curve(middle, self._of_budget(middle))]
        return [curves_svg(curves, ("Result; thin: that of the budget", ""), ("Density", ""))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw both distributions with their intervals, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis = axes[0, 0]
        # The outermost draws would compress the rest of the picture.
        low, high = np.quantile(self.sample, [0.001, 0.999])
        axis.hist(self.sample, bins=120, range=(low, high), density=True, color="#B8D4E8", label="Monte Carlo")
        at = np.linspace(low, high, 400)
        axis.plot(at, self._of_budget(at), color="#D55E00", label="budget, normal")
        for ends, colour, dashes in ((self.interval, "#0072B2", "-"), (self.budget_interval, "#D55E00", "--")):
            for end in ends:
                axis.axvline(end, color=colour, linestyle=dashes)
        axis.set_xlabel(axis_label("Result", "SI units"))
        axis.set_ylabel("Probability density")
        # Inside the axes the legend would cover the lines of the intervals.
        drawing.legend(loc="outside upper center", ncols=2, fontsize=8)
        return styled(drawing, style)

    def _of_budget(self, at: np.ndarray) -> np.ndarray:
        """Return the normal density of the budget."""
        return np.exp(-(((at - self.value) / self.budget_std) ** 2) / 2) / (self.budget_std * math.sqrt(2 * math.pi))


def simulated(
    formula: Callable[[Mapping[str, Any]], Any],
    inputs: Mapping[str, Input],
    correlation: np.ndarray,
    draws: int,
    seed: int,
) -> np.ndarray:
    """Draw the inputs of a formula and return its results, shape (draws,).

    Raises:
        UsageError: a correlated input is not normal.
    """
    import jax

    names = list(inputs)
    correlated = np.any(correlation != np.eye(len(names)), axis=1)
    for name, is_correlated in zip(names, correlated, strict=True):
        if is_correlated and not inputs[name].is_normal:
            raise UsageError(
                f"{name} is correlated but not normal with a known uncertainty: Monte Carlo draws correlated inputs "
                "from a joint normal distribution (JCGM 101, 6.4.8)."
            )
    generator = np.random.default_rng(seed)
    # A singular matrix, e.g. of two equal inputs, has a square root but no Cholesky factor.
    eigenvalues, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.clip(eigenvalues, 0.0, None))
    each = jax.jit(jax.vmap(lambda values: formula(values)))
    results = []
    with working("Drawing inputs", draws) as task:
        for first in range(0, draws, _BLOCK):
            # All blocks have the same size, so that JAX compiles the formula once.
            block = {name: inputs[name].draw(generator, _BLOCK) for name in names}
            if correlated.any():
                errors = generator.normal(size=(_BLOCK, len(names))) @ root.T
                joint = {name: inputs[name].value + inputs[name].std * errors[:, i] for i, name in enumerate(names)}
                block |= {name: joint[name] for name, is_one in zip(names, correlated, strict=True) if is_one}
            results.append(np.asarray(each(block))[: draws - first])
            task.advance(results[-1].size)
    return np.concatenate(results)


def _tolerance(std: float) -> float:
    """Return half a unit of the second significant digit (JCGM 101, 7.9.2)."""
    if std == 0:
        return 0.0
    return 0.5 * 10.0 ** (math.floor(math.log10(std)) - _DIGITS + 1)


def _shortest(ordered: np.ndarray, level: float) -> tuple[float, float]:
    """Return the shortest interval with a fraction `level` of sorted results.

    JCGM 101, 7.7.4.
    """
    inside = min(max(round(level * ordered.size), 1), ordered.size - 1)
    first = int(np.argmin(ordered[inside:] - ordered[:-inside]))
    return float(ordered[first]), float(ordered[first + inside])
