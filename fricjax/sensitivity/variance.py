"""Global sensitivities: Sobol's indices, and their bounds by exact derivatives.

The first index of a parameter is the fraction of the variance that it alone explains. The total index is the fraction
that remains if all other parameters are known (Sobol, Math. Comput. Simul. 55, 271, 2001; by Saltelli's design, from
SALib). Derivatives need one pass for all parameters and bound the total index of a parameter of range w,

    S_T <= E[(df/dx)^2] w^2/(pi^2 V),

(Sobol and Kucherenko, Math. Comput. Simul. 79, 3009, 2009). A parameter with a small bound is certainly unimportant.
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
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, styled


@dataclasses.dataclass(frozen=True, eq=False)
class Sobol(Reported):
    """Global sensitivities of a quantity.

    Attributes:
        names: parameters; `ranges`: lower and upper end of each, SI units.
        mean, variance: mean and variance of the quantity over the ranges.
        first, total: Sobol's indices, shape (p,); `first_errors`, `total_errors`: half-widths of their 95 % intervals.
        derivatives: mean squares of the derivatives, in squared units of the quantity over those of each parameter.
        bounds: upper bounds of the total indices from the derivatives, shape (p,).
        evaluations: number of evaluations of the quantity.

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
        """Return the parameters, the largest total index first."""
        rows, kinds = [], {"first": (self.first, self.first_errors), "total": (self.total, self.total_errors)}
        for i in np.argsort(-self.total):
            low, high = self.ranges[self.names[i]]
            indices = [
                Cell(f"{index[i]:.3f} +/- {error[i]:.3f}", **{kind: index[i], f"{kind}_error": error[i]})
                for kind, (index, error) in kinds.items()
            ]
            span, bound = Cell(f"{low:g} to {high:g}", low=low, high=high), self.bounds[i]
            rows.append([self.names[i], span, *indices, Cell(f"{bound:.3g}", bound=bound)])
        heads = ["Parameter", "Range", "First index", "Total index", "Bound by derivatives"]
        facts = [("mean", f"{self.mean:.4g}"), ("standard deviation", f"{math.sqrt(self.variance):.3g}")]
        facts.append(("computed", f"{self.evaluations} times"))
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return Report([Table(heads, rows, "Global sensitivity")], facts, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the indices as bars, and the bounds as marks, in matplotlib.

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
    """Return global sensitivities of a quantity, by batched simulation.

    Args:
        quantity: function that takes the parameters by name, in SI units, and returns a number. JAX traces it, e.g. a
            function with `fricjax.simulate`.
        ranges: lower and upper end of each parameter; all values between them are equally likely.
        samples: base of the design, a power of two; the quantity is evaluated `samples (p + 2)` times.
        seed: seed of the design; the same seed gives the same numbers.

    Returns:
        The indices, with their errors, and the bounds.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: SALib is not installed, a range or the number of samples is not valid, or the quantity is not
            finite.

    Examples:
        The stop of a mass depends on friction far more than on damping:

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
    # The first row of each group is an independent point. The other rows differ from it in one number.
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
