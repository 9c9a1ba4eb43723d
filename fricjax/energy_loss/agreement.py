"""The routes side by side on the same runs: where they disagree, the model does not hold.

Each route sees something else of a run: the trace all of it, the pairs only where it starts and ends, the energy its
losses half-cycle by half-cycle or sample by sample. Under the right law all give the same coefficient.

They see the same samples, so their errors go together, and a mean of them is no better than its best part: what a
less precise route differs by from one that takes all there is to take is noise of its own (Hausman, Econometrica 46,
1251, 1978). So the most precise route speaks for all, and the others test it.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..data import Record
from ..data.gather import gather
from ..data.record import labels
from ..errors import DataError, UsageError
from ..estimation.covariance import COVERAGE
from ..fitting import BatchFit, fit_batch
from ..friction import Coulomb
from ..pairs.diagnostics import scale_of
from ..pairs.displacements import Pairs, pairs_of
from ..pairs.final_displacement import fit_final_displacements
from ..pairs.result import RouteFit
from ..pairs.triangle_map import fit_triangle_map
from ..rig import Rig
from ..show import Table, plain, uncertain
from .force_map import friction_force_map
from .half_cycles import half_cycle_friction

_START = 0.01
_DISTANT = 3.0


class Route(NamedTuple):
    """One route's dynamic coefficient and from how many runs it comes.

    Its standard error is that from the runs alone, widened as Student's interval is where it rests on few residuals.
    """

    name: str
    mu: float
    std: float
    runs: int


@dataclasses.dataclass(frozen=True)
class Agreement:
    """The routes on the same runs.

    Attributes:
        routes: what each route found; a route that found nothing is in `failures`, with the reason.
        failures: sentences by name of the route.
        mu, std: coefficient of the most precise route and its standard error, enlarged where the others contradict it.
        chi2: sum of squared distances of the others from it in their standard errors; `dof`: their number.
        spread: largest relative distance between two routes.
        tolerance: relative distance that counts as agreement.
        sources: name of the file of each run, empty where it has none.
    """

    routes: tuple[Route, ...]
    failures: dict[str, str]
    mu: float
    std: float
    chi2: float
    dof: int
    spread: float
    tolerance: float
    sources: tuple[str, ...]

    @property
    def agree(self) -> bool:
        """Whether all routes lie within the tolerance."""
        return len(self.routes) > 1 and self.spread <= self.tolerance

    @property
    def verdict(self) -> str:
        """What that says of the model, in one sentence."""
        if len(self.routes) < 2:
            return "Fewer than two routes gave a number, so the model is not tested."
        told = f"{len(self.routes)} routes lie within {self.spread:.2g} of each other"
        if self.agree:
            return f"{told}: one coefficient of Coulomb friction describes the runs."
        off = max(self.routes, key=lambda route: abs(route.mu - self.mu))
        near = all(abs(route.mu - self.mu) <= _DISTANT * route.std for route in self.routes)
        if near:
            return (
                f"{told}, more than the tolerance of {self.tolerance:g}, if no more than their own scatter allows: the "
                "runs do not have one coefficient in common. Look at the force map, and record more runs."
            )
        return (
            f"{told}, more than their standard errors and the tolerance of {self.tolerance:g} allow; farthest is "
            f"{off.name}. The law, the damping or the release is not what it was taken for: look at the force map."
        )

    def table(self) -> Table:
        """One row per route."""
        rows = [[r.name, uncertain(r.mu, r.std), plain(r.mu / self.mu - 1, 2), str(r.runs)] for r in self.routes]
        rows += [[name, "", "", reason] for name, reason in self.failures.items()]
        return Table(["Route", "mu", "From the most precise (relative)", "Runs"], rows)

    def summary(self) -> str:
        """The comparison as plain text."""
        told = f"runs: {', '.join(labels(self.sources))}\n" if any(self.sources) else ""
        return f"{self.table().text()}\n\n{told}most precise: {uncertain(self.mu, self.std)}\n{self.verdict}"

    def _repr_html_(self) -> str:
        return f"{self.table().html()}<p>most precise: {uncertain(self.mu, self.std)}. {self.verdict}</p>"

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain data."""
        return {
            **{
                name: getattr(self, name)
                for name in ("sources", "mu", "std", "chi2", "dof", "spread", "tolerance", "failures")
            },
            "routes": [route._asdict() for route in self.routes],
            "agree": self.agree,
            "verdict": self.verdict,
        }


def compare_routes(records: Any, rig: Rig, *, tolerance: float = 1e-3) -> Agreement:
    """The dynamic coefficient of Coulomb friction by every route from the same runs.

    The uncertainties of the rig move all routes together and are left out.

    Args:
        records: runs that come to rest, better with several half-cycles each; each given as to :func:`fricjax.fit`.
        rig: the machine, with its damping.
        tolerance: relative distance that counts as agreement.

    Raises:
        UsageError: no records, or no route that gave a number; the sentence names why the first one failed.
        DataError: a run that cannot be read.
        RuntimeError: JAX computes in single precision.

    ```python
    fricjax.compare_routes(["run1.csv", "run2.csv", "run3.csv"], rig).summary()
    ```
    """
    runs = gather(records)
    routes, failures = [], {}
    for name, route in _ROUTES.items():
        try:
            found = route(runs, rig)
        except (DataError, UsageError) as error:
            failures[name] = str(error)
        else:
            routes.append(Route(name, *found))
    if not routes:
        raise UsageError(f"No route gave a number. {next(iter(failures))}: {next(iter(failures.values()))}")
    return _joined(tuple(routes), failures, tolerance, tuple(run.name for run in runs))


def _joined(
    routes: tuple[Route, ...], failures: dict[str, str], tolerance: float, sources: tuple[str, ...]
) -> Agreement:
    best = min(routes, key=lambda route: route.std)
    others = [route for route in routes if route is not best]
    chi2 = float(sum(((route.mu - best.mu) / route.std) ** 2 for route in others))
    std = best.std * float(np.sqrt(max(chi2 / max(len(others), 1), 1.0)))
    spread = float(np.ptp([route.mu for route in routes]) / abs(best.mu))
    return Agreement(routes, failures, best.mu, std, chi2, len(others), spread, tolerance, sources)


def weighted_mean(values: np.ndarray, stds: np.ndarray) -> tuple[float, float, float]:
    """Mean of independent runs by inverse variance, its standard error as :class:`Route` has it, and chi^2."""
    known = np.isfinite(values) & np.isfinite(stds) & (stds > 0)
    values, weights = values[known], 1 / stds[known] ** 2
    mean = float(values @ weights / weights.sum())
    chi2 = float(((values - mean) ** 2) @ weights)
    scale = scale_of(chi2, values.size - 1, known=True)
    return mean, scale.factor * scale.half_width / COVERAGE * float(weights.sum() ** -0.5), chi2


def _by_trace(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    """Route 1: every trace by itself, from its first reversal."""
    found: BatchFit = fit_batch(records, rig.oscillator(Coulomb(_START)), ("mu", "stiffness"))
    good = found.optimum_found & np.isfinite(found.std_errors["mu"])
    if not good.any():
        raise DataError(f"No trace could be fitted. The first: {found.status[0]}")
    mean, std, _ = weighted_mean(*(values[good] for values in _coefficients(found, rig)))
    return mean, std, int(good.sum())


def _coefficients(found: BatchFit, rig: Rig) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard errors of ``k x_d/N`` with the rig's stiffness; the fitted one only gives the frequency."""
    machine = rig.oscillator(Coulomb(_START))
    scale = float(machine.stiffness) / float(machine.normal_force)
    return found.kinematics["dead_band"] * scale, found.kinematics_std["dead_band"] * scale


def _by_pairs(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    pairs = _moved(records)
    machine = rig.oscillator(Coulomb(_START))
    return _of_pairs(fit_final_displacements(pairs.x0, pairs.xf, machine, half_cycles=pairs.half_cycles))


def _by_map(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    pairs = _moved(records)
    return _of_pairs(fit_triangle_map(pairs.x0, pairs.xf, _exact(rig), half_cycles=pairs.half_cycles))


def _of_pairs(found: RouteFit) -> tuple[float, float, int]:
    low, high = found.intervals["mu"]
    if not found.converged or not np.isfinite(high - low):
        raise DataError(f"The fit is not valid, {found.status}" if not found.converged else " ".join(found.warnings))
    return found.values["mu"], (high - low) / 2 / COVERAGE, found.x0.size


def _by_half_cycles(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    found = half_cycle_friction(list(records), _exact(rig))
    return found.mu.value, found.mu.std, len(found.offsets)


def _by_samples(records: Sequence[Record], rig: Rig) -> tuple[float, float, int]:
    found = friction_force_map(list(records), _exact(rig))
    return found.mu.value, found.mu.std, len(found.offsets)


_ROUTES: dict[str, Callable[[Sequence[Record], Rig], tuple[float, float, int]]] = {
    "1 traces": _by_trace,
    "2 final displacements": _by_pairs,
    "3 triangle map": _by_map,
    "4 energy, half-cycles": _by_half_cycles,
    "4 energy, samples": _by_samples,
}


def _moved(records: Sequence[Record]) -> Pairs:
    """Pairs from the first reversal of those runs in which the mass moves on after it."""
    usable = [pair for record in records if (pair := _pair(record)) is not None]
    if not usable:
        raise DataError("No run moves on after its first reversal and comes to rest. Release from farther away.")
    columns = (np.concatenate(column) for column in zip(*usable, strict=True))
    return Pairs(*columns)


def _pair(record: Record) -> Pairs | None:
    try:
        pair = pairs_of([record])
    except DataError:
        return None
    return pair if pair.half_cycles is not None and pair.half_cycles[0] > 0 else None


def _exact(rig: Rig) -> Rig:
    """The rig without its uncertainties, which all routes share."""
    return rig.replace(**{name: value.value for name, value in rig.numbers().items() if value.std > 0 and name != "k3"})
