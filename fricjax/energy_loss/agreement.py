"""Comparison of all routes on the same runs.

Each route uses different information: the whole trace, the displacements at start and end, or the energy loss by
half-cycles or samples. Under the right law all routes give the same coefficient; a disagreement shows model error.

The routes use the same samples, so their errors are correlated and their mean is no better than the most precise route.
The difference between a less precise route and an efficient one is noise of the former (Hausman, Econometrica 46, 1251,
1978). The most precise route therefore gives the result, and the others test it.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..data import Record
from ..data.gather import gather
from ..data.record import check_displacement, listed
from ..errors import DataError, UsageError
from ..estimation.covariance import COVERAGE
from ..fitting import fit_batch
from ..friction import Coulomb
from ..pairs.diagnostics import scale_of
from ..pairs.displacements import Pairs, pairs_of
from ..pairs.final_displacement import fit_final_displacements
from ..pairs.result import RouteFit
from ..pairs.triangle_map import fit_triangle_map
from ..rig import Measured, Rig
from ..show import Cell, Report, Reported, Style, Table, figure, plain, styled, uncertain
from ..show.thumbnail import Curve, curves_svg
from .force_map import friction_force_map
from .half_cycles import half_cycle_friction

# Start value of mu. Only its order of magnitude matters, because the fits search for better start values.
_START = 0.01


class Route(NamedTuple):
    """The dynamic coefficient of one route, and its number of runs.

    The standard error of `mu` comes from the runs alone. With few residuals it is widened to match Student's interval.

    Examples:
        >>> Route("1 traces", mu=Measured(0.05, 1e-6), runs=6).mu
        0.0500000(10)
    """

    name: str
    mu: Measured
    runs: int


@dataclasses.dataclass(frozen=True)
class Agreement(Reported):
    """The routes on the same runs.

    Attributes:
        routes: coefficient of each route that succeeded.
        failures: error messages by name of the route that failed.
        mu: coefficient of the most precise route; its standard error is enlarged if the others contradict it.
        chi2: sum of squared deviations of the others from it, in their standard errors; `dof`: their number.
        spread: largest relative difference between two routes.
        tolerance: relative difference that counts as agreement.
        sources: name of the file of each run; empty without a name.

    Examples:
        >>> one, other = Measured(0.05, 1e-6), Measured(0.05001, 1e-5)
        >>> routes = Route("1 traces", one, 6), Route("3 triangle map", other, 6)
        >>> Agreement(routes, {}, one, 1.0, 1, 2e-4, 1e-3, ()).agree
        True
    """

    routes: tuple[Route, ...]
    failures: dict[str, str]
    mu: Measured
    chi2: float
    dof: int
    spread: float
    tolerance: float
    sources: tuple[str, ...]

    @property
    def agree(self) -> bool:
        """True if all routes agree within the tolerance."""
        return len(self.routes) > 1 and self.spread <= self.tolerance

    @property
    def conclusion(self) -> str:
        """The conclusion about the model, in one sentence."""
        if len(self.routes) < 2:
            return "Fewer than two routes gave a number, so the model is not tested."
        spread = f"{len(self.routes)} routes lie within {self.spread:.2g} of each other"
        if self.agree:
            return f"{spread}: one coefficient of Coulomb friction describes the runs."
        distance = lambda route: abs(route.mu.value - self.mu.value)
        off = max(self.routes, key=distance)
        if all(distance(route) <= thresholds.SUSPECTED * route.mu.std for route in self.routes):
            return (
                f"{spread}, more than the tolerance of {self.tolerance:g}, but within their own scatter: "
                "the runs do not have one coefficient in common. Look at the force map, and record more runs."
            )
        return (
            f"{spread}, more than their standard errors and the tolerance of {self.tolerance:g} allow; farthest is "
            f"{off.name}. The law, the damping or the release differs from the model: look at the force map."
        )

    def thumbnails(self) -> Sequence[str]:
        number = np.arange(1, len(self.routes) + 1)
        means = Curve(number, [r.mu.value for r in self.routes], [r.mu.std for r in self.routes])
        return [curves_svg([means], ("Route, as in the table", ""), ("mu", ""))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the coefficient by route with its standard error.

        A band shows the tolerance.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure()
        names, means = [r.name for r in self.routes], [r.mu for r in self.routes]
        bars = {"linestyle": "none", "marker": "o", "markersize": 4, "capsize": 3}
        axes[0, 0].errorbar([mu.value for mu in means], names, xerr=[mu.std for mu in means], **bars)
        span = self.tolerance * abs(self.mu.value)
        axes[0, 0].axvspan(self.mu.value - span, self.mu.value + span, color="0.9", zorder=0)
        axes[0, 0].invert_yaxis()
        axes[0, 0].set_xlabel("Coefficient of friction; band: the tolerance")
        axes[0, 0].ticklabel_format(axis="x", useOffset=False)
        return styled(drawing, style)

    def report(self) -> Report:
        """Report one row per route, the files, and the conclusion."""
        off = {r.name: r.mu.value / self.mu.value - 1 for r in self.routes}
        rows = [[r.name, r.mu, Cell(plain(off[r.name], 2), difference=off[r.name]), r.runs] for r in self.routes]
        rows += [[name, None, None, Cell(reason, failure=reason)] for name, reason in self.failures.items()]
        files = [("runs", listed(self.sources))] if any(self.sources) else []
        facts = [*files, ("most precise", uncertain(self.mu.value, self.mu.std)), ("agreement", self.conclusion)]
        table = Table(["Route", "mu", "From the most precise (relative)", "Runs"], rows)
        return Report([table], facts, data=vars(self) | {"agree": self.agree, "conclusion": self.conclusion})


def compare_routes(records: Any, rig: Rig, *, tolerance: float = 1e-3) -> Agreement:
    """Compare the Coulomb coefficients of all routes on the same runs.

    The uncertainties of the rig are left out, because they affect all routes alike.

    Args:
        records: runs that come to rest, preferably after several half-cycles; each as for :func:`fricjax.fit`.
        rig: the machine, with its damping.
        tolerance: relative difference that counts as agreement.

    Raises:
        UsageError: no records, or all routes failed; the message states why the first one failed.
        DataError: a run that cannot be read.
        RuntimeError: JAX computes in single precision.

    Examples:
        >>> import fricjax as fj
        >>> rig = fj.Rig(mass=0.4, stiffness=2500.0, damping=0.2, normal_force=10.0)
        >>> machine = rig.oscillator(fj.friction.Coulomb(0.05))
        >>> runs = [
        ...     fj.synthetic_run(machine, x0, rate=5e3, duration=0.5, noise=1e-9, seed=i)
        ...     for i, x0 in enumerate([1.2e-3, 1.6e-3, 2e-3])
        ... ]
        >>> agreement = fj.compare_routes(runs, rig)
        >>> agreement.agree, round(agreement.mu.value, 5), len(agreement.routes)
        (True, 0.05, 5)
    """
    runs, exact = gather(records), _exact(rig)
    routes, failures = [], {}
    for name, evaluate in _ROUTES.items():
        try:
            mu, std, used = evaluate(runs, exact)
            routes.append(Route(name, Measured(mu, std), used))
        except (DataError, UsageError) as error:
            failures[name] = str(error)
    if not routes:
        raise UsageError(f"No route gave a number. {next(iter(failures))}: {next(iter(failures.values()))}")
    best = min(routes, key=lambda route: route.mu.std)
    others = [route.mu for route in routes if route is not best]
    chi2 = float(sum(((mu.value - best.mu.value) / mu.std) ** 2 for mu in others))
    mu = Measured(best.mu.value, best.mu.std * float(np.sqrt(max(chi2 / max(len(others), 1), 1.0))))
    spread = float(np.ptp([route.mu.value for route in routes]) / abs(mu.value))
    sources = tuple(run.name for run in runs)
    return Agreement(tuple(routes), failures, mu, chi2, len(others), spread, tolerance, sources)


def weighted_mean(values: np.ndarray, stds: np.ndarray) -> tuple[float, float, float]:
    """Return the weighted mean of independent runs, its standard error and chi^2.

    The weights are inverse variances. The standard error is defined as in :class:`Route`.
    """
    known = np.isfinite(values) & np.isfinite(stds) & (stds > 0)
    values, weights = values[known], 1 / stds[known] ** 2
    mean = float(values @ weights / weights.sum())
    chi2 = float(((values - mean) ** 2) @ weights)
    scale = scale_of(chi2, values.size - 1, known=True)
    return mean, scale.factor * scale.half_width / COVERAGE * float(weights.sum() ** -0.5), chi2


def _by_trace(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    """Route 1: fit each trace separately, from its first reversal."""
    machine = rig.oscillator(Coulomb(_START))
    batch = fit_batch(records, machine, ("mu", "stiffness"))
    good = batch.optimum_found & np.isfinite(batch.std_errors["mu"])
    if not good.any():
        raise DataError(f"No trace could be fitted. The first: {batch.status[0]}")
    # mu = k x_d/N with the rig's stiffness; the fitted stiffness only gives the frequency.
    scale = float(machine.stiffness) / float(machine.normal_force)
    bands, stds = batch.kinematics["dead_band"] * scale, batch.kinematics_std["dead_band"] * scale
    mean, std, _ = weighted_mean(bands[good], stds[good])
    return mean, std, int(good.sum())


def _by_pairs(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    pairs, machine = _moved(records), rig.oscillator(Coulomb(_START))
    return _of_pairs(fit_final_displacements(pairs.x0, pairs.xf, machine, half_cycles=pairs.half_cycles))


def _by_map(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    pairs = _moved(records)
    return _of_pairs(fit_triangle_map(pairs.x0, pairs.xf, rig, half_cycles=pairs.half_cycles))


def _of_pairs(fit: RouteFit) -> tuple[float, float, int]:
    low, high = fit.intervals["mu"]
    if not fit.converged or not np.isfinite(high - low):
        raise DataError(f"The fit is not valid, {fit.status}" if not fit.converged else " ".join(fit.warnings))
    return fit.values["mu"], (high - low) / 2 / COVERAGE, fit.x0.size


# The energy routes average over all half-cycles or samples; the number of runs is that of the runs used.
def _by_energy(evaluate: Callable[..., Any]) -> Callable[[Sequence[Record], Rig], tuple[float, float, int]]:
    def mean(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
        friction = evaluate(list(records), rig)
        return friction.mu.value, friction.mu.std, len(friction.offsets)

    return mean


_ROUTES: dict[str, Callable[[Sequence[Record], Rig], tuple[float, float, int]]] = {
    "1 traces": _by_trace,
    "2 final displacements": _by_pairs,
    "3 triangle map": _by_map,
    "4 energy, half-cycles": _by_energy(half_cycle_friction),
    "4 energy, samples": _by_energy(friction_force_map),
}


def _moved(records: Sequence[Record]) -> Pairs:
    """Return the pairs of all runs that move after their first reversal."""
    usable = []
    for record in records:
        check_displacement(record, "a final displacement")
        try:
            pair = pairs_of([record])
        except DataError:
            continue
        if pair.half_cycles is not None and pair.half_cycles[0] > 0:
            usable.append(pair)
    if not usable:
        raise DataError("No run moves on after its first reversal and comes to rest. Release from farther away.")
    return Pairs(*map(np.concatenate, zip(*usable, strict=True)))


def _exact(rig: Rig) -> Rig:
    """Return the rig without the uncertainties that all routes share."""
    return rig.replace(**{name: value.value for name, value in rig.numbers().items() if value.std > 0 and name != "k3"})
