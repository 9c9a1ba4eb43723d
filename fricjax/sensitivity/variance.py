"""Which parameter decides over whole ranges: Sobol's indices, and their bound by exact derivatives.

The first index of a parameter is the part of the variance that it alone explains, the total one the part that is left
when all others are known (Sobol, Math. Comput. Simul. 55, 271, 2001; by Saltelli's design, from SALib). Derivatives
cost one pass for all parameters and bound the total index of a parameter of range w,

    S_T <= E[(df/dx)^2] w^2/(pi^2 V),

(Sobol and Kucherenko, Math. Comput. Simul. 79, 3009, 2009), so that what they call small is small for certain.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import UsageError, needed
from ..oscillator import ready
from ..show import Report, Reported, Style, Table, axis_label, figure, styled


@dataclasses.dataclass(frozen=True, eq=False)
class Sobol(Reported):
    """Global sensitivities of a quantity.

    Attributes:
        names: parameters; `ranges`: lower and upper end of each, SI units.
        mean, variance: of the quantity over the ranges.
        first, total: Sobol's indices, shape (p,); `first_errors`, `total_errors`: half-widths of their 95 % intervals.
        derivatives: mean squares of the derivatives, in units of the quantity over that of each parameter, squared.
        bounds: upper bounds of the total indices that follow from them, shape (p,).
        evaluations: number of times the quantity was computed.

    Examples:
        >>> import fricjax as fj
        >>> found = fj.sensitivity.sobol(lambda p: p["a"] + 2 * p["b"], {"a": (0.0, 1.0), "b": (0.0, 1.0)}, samples=256)
        >>> found.total.round(1).tolist()
        [0.2, 0.8]
    """

    names: tuple[str, ...]
    ranges: dict[str, tuple[float, float]]
    mean: float
    variance: float
    first: np.ndarray
    total: np.ndarray
    first_errors: np.ndarray
    total_errors: np.ndarray
    derivatives: np.ndarray
    bounds: np.ndarray
    evaluations: int

    def report(self) -> Report:
        """The parameters, that of the largest total index first."""
        rows = []
        for i in np.argsort(-self.total):
            first, total = (
                f"{index[i]:.3f} +/- {error[i]:.3f}"
                for index, error in ((self.first, self.first_errors), (self.total, self.total_errors))
            )
            low, high = self.ranges[self.names[i]]
            rows.append([self.names[i], f"{low:g} to {high:g}", first, total, f"{self.bounds[i]:.3g}"])
        heads = ["Parameter", "Range", "First index", "Total index", "Bound by derivatives"]
        facts = [("mean", f"{self.mean:.4g}"), ("standard deviation", f"{math.sqrt(self.variance):.3g}")]
        facts.append(("computed", f"{self.evaluations} times"))
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return Report([Table(heads, rows, "Global sensitivity")], facts, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """First and total indices as bars, with the bounds of the latter as marks; a matplotlib figure.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis, order = axes[0, 0], np.argsort(-self.total)
        places = np.arange(order.size)
        axis.barh(places - 0.2, self.first[order], 0.4, xerr=self.first_errors[order], label="first")
        axis.barh(places + 0.2, self.total[order], 0.4, xerr=self.total_errors[order], label="total")
        inside = np.minimum(self.bounds[order], 1.05)
        axis.plot(inside, places + 0.2, "k|", markersize=12, label="bound of the total, at most 1.05")
        axis.set_yticks(places, [self.names[i] for i in order])
        axis.invert_yaxis()
        axis.set_xlabel(axis_label("Part of the variance", "1"))
        axis.legend()
        return styled(drawing, style)


def sobol(
    quantity: Callable[[Mapping[str, Any]], Any],
    ranges: Mapping[str, tuple[float, float]],
    *,
    samples: int = 1024,
    seed: int = 0,
) -> Sobol:
    """Global sensitivities of a number that follows from parameters, by batched simulation.

    Args:
        quantity: takes the parameters by name, in SI units, and returns a number; in terms that JAX can trace, as
            `fricjax.simulate`.
        ranges: lower and upper end of each parameter, within which all values are as likely.
        samples: base of the design, a power of two; the quantity is computed `samples (p + 2)` times.
        seed: of the design; the same seed gives the same numbers.

    Returns:
        The indices, with their errors, and the bounds.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: SALib is not installed, a range or a number of samples that is none, or a quantity that is not
            finite.

    Examples:
        Where a mass stops is decided by friction far more than by damping:

        >>> import numpy as np
        >>> import fricjax as fj
        >>> def decay(p):
        ...     machine = fj.Oscillator(0.4, 2500.0, p["damping"], 10.0, fj.friction.Coulomb(p["mu"]))
        ...     return fj.simulate(machine, 2e-3, np.array([0.0, 0.3]), engine="exact").x[1]
        >>> found = fj.sensitivity.sobol(decay, {"mu": (0.03, 0.0301), "damping": (0.1, 0.1001)}, samples=16)
        >>> found.names[int(found.total.argmax())]
        'mu'
    """
    ready()
    if not ranges or samples < 2 or samples & (samples - 1):
        raise UsageError(f"Give at least one range, and a power of two of samples, got {len(ranges)} and {samples}.")
    for name, (low, high) in ranges.items():
        if not -math.inf < low < high < math.inf:
            raise UsageError(f"The range of {name} must be a lower and a larger upper end, got {low} and {high}.")
    design = needed("A global sensitivity", "SALib.sample.sobol", "sens")
    indices = needed("A global sensitivity", "SALib.analyze.sobol", "sens")
    names, ends = tuple(ranges), np.array(list(ranges.values()), float)
    problem = {"num_vars": len(names), "names": list(names), "bounds": ends.tolist()}
    points = design.sample(problem, samples, calc_second_order=False, seed=seed)

    def of(point: Any) -> Any:
        return jnp.asarray(quantity(dict(zip(names, point, strict=True))), float).reshape(())

    values = np.asarray(jax.jit(jax.vmap(of))(points))
    # The first of each group of rows is a point of its own, the others share all but one number with it.
    bases = points[:: len(names) + 2]
    slopes = np.asarray(jax.jit(jax.vmap(jax.jacfwd(of)))(bases))
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(slopes))):
        raise UsageError("The quantity or its derivative is not finite all over the ranges. Make the ranges smaller.")
    by_design = indices.analyze(problem, values, calc_second_order=False, seed=seed, print_to_console=False)
    mean, variance = float(values.mean()), float(values.var())
    squares = np.mean(slopes**2, axis=0)
    bounds = squares * np.ptp(ends, axis=1) ** 2 / (math.pi**2 * variance)
    by_name = {name: (float(low), float(high)) for name, (low, high) in ranges.items()}
    first, total, *errors = (np.asarray(by_design[key]) for key in ("S1", "ST", "S1_conf", "ST_conf"))
    return Sobol(names, by_name, mean, variance, first, total, errors[0], errors[1], squares, bounds, int(values.size))
