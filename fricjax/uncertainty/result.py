"""Uncertainty budgets: the contribution of each input and the expanded uncertainty.

Uncertainties are propagated by JCGM 100:2008, equation 13, with correlated inputs. The effective degrees of freedom are
those of Welch and Satterthwaite (G.2b). The coverage factor is that of Student's distribution.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import needed
from ..rig.measured import Measured
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, interval, plain, styled, uncertain
from ..show.thumbnail import bars_svg
from .inputs import Input
from .monte_carlo import MonteCarlo, simulated


class Expanded(NamedTuple):
    """An expanded uncertainty.

    Attributes:
        half_width: U; the interval ``value +/- U`` contains the quantity with probability `level`.
        factor: coverage factor k.
        level: coverage probability.
        unit: of U.

    Examples:
        >>> from fricjax.uncertainty import Input, propagate
        >>> load = propagate(lambda m, g: m * g, {"m": Input(1.0, 1e-3, "kg"), "g": Input(9.81, 0.0)}, unit="N")
        >>> print(load.expanded())
        0.019 N (k = 1.96, 95 %)
    """

    half_width: float
    factor: float
    level: float
    unit: str = ""

    def __str__(self) -> str:
        size = f"{self.half_width:.2g} {self.unit}".rstrip()
        return f"{size} (k = {self.factor:.2f}, {100 * self.level:g} %)"


@dataclasses.dataclass(frozen=True, eq=False)
class Budget(Reported):
    """An uncertainty budget.

    `fricjax.uncertainty.budget` returns the budget of a fit, `propagate` the budget of any formula.

    Attributes:
        quantity, unit: name and SI unit of the result.
        value: the result.
        inputs: by name.
        sensitivities: derivative of the result with respect to each input, by name.
        correlation: correlation matrix of the errors of the inputs, in the order of `inputs`, shape (n, n).
        formula: function that takes one value of each input, by name, and returns the result.
        notes: sentences about the assumptions of the budget.

    Examples:
        >>> from fricjax.uncertainty import Input, propagate
        >>> inputs = {"k": Input(2574.0, 25.7, "N/m"), "x": Input(1e-4, 1e-8, "m"), "load": Input(9.66, 0.05, "N")}
        >>> mu = propagate(lambda k, x, load: k * x / load, inputs, quantity="mu")
        >>> print(mu.summary())
        Uncertainty budget of mu
        Input            Value  Unit  Type  Distribution  Sensitivity  Contribution     Share
        ─────  ───────────────  ────  ────  ────────────  ───────────  ────────────  ────────
        k             2574(26)  N/m   B     normal           1.04e-05       0.00027      79 %
        load         9.660(50)  N     B     normal           -0.00276       0.00014      21 %
        x      0.000100000(10)  m     B     normal                266       2.7e-06  < 0.01 %
        <BLANKLINE>
        mu:                   0.02665(30)
        relative:             1.1 %
        expanded uncertainty: 0.00059 (k = 1.96, 95 %)
        degrees of freedom:   inf
    """

    quantity: str
    unit: str
    value: float
    inputs: Mapping[str, Input]
    sensitivities: Mapping[str, float]
    correlation: np.ndarray
    formula: Callable[[Mapping[str, Any]], Any]
    notes: tuple[str, ...] = ()

    @property
    def contributions(self) -> dict[str, float]:
        """Signed change of the result by one standard uncertainty of each input."""
        return {name: self.sensitivities[name] * each.std for name, each in self.inputs.items()}

    @property
    def std(self) -> float:
        """Combined standard uncertainty."""
        parts = np.array(list(self.contributions.values()))
        return math.sqrt(max(float(parts @ self.correlation @ parts), 0.0))

    @property
    def measured(self) -> Measured:
        """The result with its combined standard uncertainty."""
        return Measured(self.value, self.std)

    @property
    def shares(self) -> dict[str, float]:
        """Fraction of the variance from each input; the fractions sum to one.

        A covariance of two inputs is divided equally between them.
        """
        parts = np.array(list(self.contributions.values()))
        shares = parts * (self.correlation @ parts) / max(self.std**2, np.finfo(float).tiny)
        return dict(zip(self.inputs, shares.tolist(), strict=True))

    @property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom by Welch and Satterthwaite.

        The formula is valid for independent inputs.
        """
        known = {name: part for name, part in self.contributions.items() if part}
        scatter = sum((part / self.std) ** 4 / self.inputs[name].degrees_of_freedom for name, part in known.items())
        return 1 / scatter if scatter else math.inf

    def expanded(self, level: float = 0.95) -> Expanded:
        """Return the uncertainty that covers the quantity with probability `level`.

        The coverage factor is that of Student's distribution.
        """
        from scipy.stats import norm, t

        freedom = self.degrees_of_freedom
        # The standard rounds the degrees of freedom down (G.4.1), so that the interval is not too short.
        upper = (1 + level) / 2
        factor = float(norm.ppf(upper) if math.isinf(freedom) else t.ppf(upper, max(np.floor(freedom), 1.0)))
        return Expanded(factor * self.std, factor, level, self.unit)

    def monte_carlo(self, draws: int = 1_000_000, *, level: float = 0.95, seed: int = 0) -> MonteCarlo:
        """Draw the inputs and compare the result with this budget.

        The comparison follows JCGM 101.

        Args:
            draws: number of draws.
            level: coverage probability of the intervals.
            seed: seed of the generator; the same seed gives the same numbers.

        Raises:
            UsageError: correlated inputs are not normal, or there are too few draws for the intervals.
        """
        values = simulated(self.formula, self.inputs, self.correlation, draws, seed)
        return MonteCarlo.of(values, self.value, self.std, self.expanded(level).half_width, level)

    def to_uncertainties(self) -> Any:
        """Return the result as a number of the package `uncertainties`.

        That number carries its derivatives with respect to the inputs.

        Raises:
            UsageError: the package is not installed; the message names the package to install.
        """
        package = needed("A number with its errors", "uncertainties", "interchange")
        pairs = [(each.value, each.std) for each in self.inputs.values()]
        errors: Any = dict(zip(self.inputs, package.correlated_values_norm(pairs, self.correlation), strict=True))
        return self.value + sum(self.sensitivities[name] * (x - self.inputs[name].value) for name, x in errors.items())

    def report(self, level: float = 0.95) -> Report:
        """Return one row per input, largest share first, and the combined result.

        Args:
            level: coverage probability of the expanded uncertainty.
        """
        expanded, freedom = self.expanded(level), self.degrees_of_freedom
        facts = [
            (self.quantity, uncertain(self.value, self.std, self.unit)),
            ("relative", f"{100 * self.measured.relative:.2g} %"),
            ("expanded uncertainty", str(expanded)),
            ("degrees of freedom", f"{freedom:.3g}" if freedom < _PLENTY else "inf"),
        ]
        correlated = np.any(self.correlation != np.eye(len(self.inputs)))
        warnings = []
        if correlated and math.isfinite(freedom):
            warnings.append(
                "The effective degrees of freedom are those of independent inputs, but some are correlated: take the "
                "interval from Monte Carlo."
            )
        names = (
            "quantity",
            "unit",
            "value",
            "std",
            "inputs",
            "sensitivities",
            "contributions",
            "shares",
            "correlation",
        )
        data = {name: getattr(self, name) for name in names}
        data |= {"degrees_of_freedom": freedom, "expanded": expanded, "relative": self.measured.relative}
        return Report([self._table()], facts, self.notes, warnings, heading="Result", data=data)

    def _table(self) -> Table:
        shares, parts = self.shares, self.contributions
        rows = []
        for name in sorted(self.inputs, key=lambda name: -abs(shares[name])):
            each = self.inputs[name]
            freedom = "" if math.isinf(each.degrees_of_freedom) else f", {each.degrees_of_freedom:.3g} d.o.f."
            number = uncertain(each.value, each.std) if each.std else plain(each.value)
            law = {"distribution": each.distribution, "degrees_of_freedom": each.degrees_of_freedom}
            known = [
                Cell(number, value=each.value, std=each.std),
                each.unit,
                each.kind,
                Cell(each.distribution + freedom if each.std else "exact", **law),
            ]
            slope = self.sensitivities[name] + 0.0
            effect = [
                Cell(f"{slope:.3g}", sensitivity=slope),
                Cell(f"{abs(parts[name]):.2g}", contribution=parts[name]),
                Cell(_percent(shares[name]), share=shares[name]),
            ]
            rows.append([name, *known, *effect])
        heads = ["Input", "Value", "Unit", "Type", "Distribution", "Sensitivity", "Contribution", "Share"]
        return Table(heads, rows, f"Uncertainty budget of {self.quantity}", {"contribution": self.unit})

    def to_latex(self) -> str:
        """Return table and result as a LaTeX tabular with booktabs rules."""
        table = self._table()
        head = " & ".join(map(_latex, table.columns))
        rows = [" & ".join(_latex(str(cell)) for cell in row) + r" \\" for row in table.rows]
        result = f"{self.quantity} = {uncertain(self.value, self.std, self.unit)}, U = {self.expanded()}"
        last = rf"\multicolumn{{{len(table.columns)}}}{{l}}{{{_latex(result)}}} \\"
        lines = [r"\begin{tabular}{llllllll}", r"\toprule", rf"{head} \\", r"\midrule", *rows]
        return "\n".join([*lines, r"\midrule", last, r"\bottomrule", r"\end{tabular}"])

    def thumbnails(self) -> Sequence[str]:
        shares = {name: 100 * abs(share) for name, share in self.shares.items() if share}
        names = sorted(shares, key=lambda name: -shares[name])[:_DRAWN]
        return [bars_svg(names, [shares[name] for name in names], "Share of the variance [%]")] if names else []

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw contributions and combined uncertainty as bars, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis = axes[0, 0]
        names = sorted(self.inputs, key=lambda name: abs(self.contributions[name]))
        names = [name for name in names if self.inputs[name].std]
        size = abs(self.value) or 1.0
        parts = [100 * abs(self.contributions[name]) / size for name in names]
        axis.barh([*names, "combined"], [*parts, 100 * self.std / size])
        axis.patches[-1].set_color("#D55E00")
        axis.set_xlabel(axis_label("Standard uncertainty relative to the value", "%"))
        reach = self.expanded()
        ends = interval(self.value - reach.half_width, self.value + reach.half_width, self.unit)
        axis.set_title(f"{self.quantity} in {ends} with {100 * reach.level:g} %", fontsize=9, loc="left")
        return styled(drawing, style)

    def __repr__(self) -> str:
        return f"Budget({self.quantity} = {uncertain(self.value, self.std, self.unit)}, {len(self.inputs)} inputs)"


# Above these degrees of freedom Student's factor has the digits of the normal one.
_PLENTY = 1e6
_DRAWN = 8  # number of shares in the thumbnail


def _percent(share: float) -> str:
    """Format a share of the variance, at a resolution of 0.01 %."""
    return "0 %" if share == 0 else f"{100 * share:.2g} %" if abs(share) >= 1e-4 else "< 0.01 %"


def _latex(text: str) -> str:
    """Escape the special characters of LaTeX."""
    signs = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    return "".join(signs.get(sign, f"\\{sign}" if sign in "&%$#_{}" else sign) for sign in text)
