"""Model discrepancy: forces that the model omits but the residuals show.

The responses to additional forces (:mod:`.responses`) are fitted to the residuals together with the free parameters,
for two purposes. First, a force may explain the residuals down to noise with a correlation time of a few samples. Then
the residuals are neither long-memory noise nor floor vibration, which would differ in every half-cycle. Second, a force
may be significant in addition to known noise. Fitting it would move the parameters, so their standard errors must
include that shift.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.colour import whitened
from ..estimation.covariance import Covariance
from ..show import rotary_unit
from .colours import white_floor_noise
from .names import NUISANCES
from .problem import Problem
from .responses import Responses, responses
from .rows import Rows, Seen
from .solve import Solution

# A response with a smaller relative square after projection is explained by the parameters, up to rounding.
_ROUNDING = 1e-10
# Part of the excess mean square that a force must explain to be the main discrepancy. Convention: for a large amplitude
# that changes the response nonlinearly, the linear response explains two thirds.
_HALF = 0.5


class Discrepancy(NamedTuple):
    """A force that the model omits.

    Attributes:
        run: number of the run that shows it.
        force: its name, one of those in `responses`.
        seen: its size in standard errors.
        shift: change of the free coordinates if the force were fitted, shape (p,).
    """

    run: int
    force: str
    seen: float
    shift: np.ndarray


class _Explained(NamedTuple):
    """Effect of a force on the residuals.

    Attributes:
        force: its name.
        size: size of its response; `effect`: response in the residuals, shape (rows,).
        before, after: mean squared residuals after fitting the parameters, without and with the force.
        degrees: degrees of freedom of the latter.
    """

    force: str
    size: float
    effect: np.ndarray
    before: float
    after: float
    degrees: int

    @property
    def seen(self) -> float:
        """Size in standard errors."""
        gain = max(self.before - self.after, 0.0) / max(self.after, np.finfo(float).tiny)
        return float(np.sqrt(gain * self.degrees))

    def discrepancy(self, run: int, slopes: np.ndarray, inverse: np.ndarray) -> Discrepancy:
        """Return the discrepancy of a run.

        `slopes` are derivatives with respect to the coordinates; `inverse` is the inverse of the normal matrix.
        """
        return Discrepancy(run, self.force, self.seen, -self.size * inverse @ (slopes.T @ self.effect))


def force_responses_of(problem: Problem, at: Solution, run: int, rows: Rows) -> Responses:
    """Return responses to additional forces at the times of a run's rows.

    They are empty for records made from the model.
    """
    if problem.made:
        return Responses((), np.zeros((rows.series.t.size, 0)), 0)
    kinds = {parameter.kind for parameter in problem.parameters}
    return responses(problem.windows[run], at.derived, kinds, rows.series.t)


def main_discrepancy(
    problem: Problem, solution: Solution, run: int, rows: Rows, force_responses: Responses
) -> Discrepancy | None:
    """Return the force that explains the residuals in motion; None without one.

    It must explain them down to noise of short memory. Floor vibration adds up, so adjacent half-cycles deviate alike,
    and a force may explain most of that by chance. A force must therefore be significant in addition to floor noise.
    """
    forces = main_forces(problem, solution, run, rows, force_responses)
    best = next((force for force, chance in forces if chance < thresholds.RARE), None)
    floor = white_floor_noise(problem, solution, run, rows) if best is not None and problem.noise == "auto" else None
    if floor is not None and significant_force(problem, solution, run, floor, force_responses) is None:
        return None
    return best


def main_forces(
    problem: Problem, solution: Solution, run: int, rows: Rows, force_responses: Responses
) -> Iterator[tuple[Discrepancy, float]]:
    """Yield forces that explain most excess residuals in motion, best first.

    Each comes with the probability of such a fit by chance.
    """
    if not force_responses.forces:
        return
    series, p = rows.series, problem.residual.n_parameters
    moving = series.t <= problem.windows[run].stopped
    slopes, residual = series.slopes[moving, :p] * ~solution.shape.at_bound, series.residual[moving]
    effects = force_responses.effects[moving] * series.unit[moving, None]
    # Second differences of adjacent rows are large for noise and small for a motion.
    noise = float(np.mean(np.diff(residual, n=2) ** 2)) / 6
    # On a vibrating floor a half-cycle has two independent numbers, an amplitude and a phase.
    independent = 2 * force_responses.half_cycles - int(np.count_nonzero(np.any(slopes, axis=0))) - 1
    forces = _seen(force_responses.forces, effects, residual, slopes, rows.samples)
    for force in sorted(forces, key=lambda force: force.after):
        excess, left = max(force.before - noise, 0.0), max(force.after - noise, 0.0)
        if left < _HALF * excess:
            chance = _chance(excess, left, independent) * len(force_responses.forces) if independent > 0 else 1.0
            yield force.discrepancy(run, slopes, solution.shape.inverse), chance


def _chance(excess: float, left: float, independent: int) -> float:
    """Return the probability of such a fit by chance (F test)."""
    # Imported here because few fits need it and the import is slow.
    from scipy.special import fdtrc

    with np.errstate(over="ignore"):
        return float(fdtrc(1, independent, (excess - left) * independent / max(left, np.finfo(float).tiny)))


def significant_force(
    problem: Problem, at: Solution, run: int, seen: Seen, force_responses: Responses
) -> Discrepancy | None:
    """Return the most significant force in addition to the noise, if any.

    Args:
        problem: the problem.
        at: its solution, with the quadratic model weighted by the noise.
        run: number of the run.
        seen: its rows and their noise.
        force_responses: the responses to forces at the times of these rows.
    """
    if not force_responses.forces:
        return None
    series, p = seen.rows.series, problem.residual.n_parameters
    together = np.column_stack(
        [series.slopes[:, :p] * ~at.shape.at_bound, force_responses.effects * series.unit[:, None]]
    )
    residual, columns = whitened(series._replace(slopes=together), seen.colour)
    forces = _seen(force_responses.forces, columns[:, p:], residual, columns[:, :p], seen.rows.samples)
    best = max(forces, key=lambda force: force.seen, default=None)
    return None if best is None else best.discrepancy(run, columns[:, :p], at.shape.inverse)


def _seen(
    forces: Sequence[tuple[str, str]], effects: np.ndarray, residual: np.ndarray, slopes: np.ndarray, samples: int
) -> list[_Explained]:
    """Return the forces with very strong evidence and a possible sign.

    The evidence is that in addition to the parameters.

    Args:
        forces: their names.
        effects: their responses, shape (rows, forces).
        residual: shape (rows,).
        slopes: its derivatives with respect to the parameters, shape (rows, p).
        samples: number of samples per row; all count in the Bayesian criterion.
    """
    columns = np.column_stack([slopes, residual, effects])
    products, p = columns.T @ columns, slopes.shape[1]
    unit = np.sqrt(np.diag(products)[:p])
    free = unit > 0
    degrees = residual.size - int(free.sum()) - 1
    if degrees < 1:
        return []
    unit = unit[free]
    within, across = products[:p, :p][np.ix_(free, free)] / np.outer(unit, unit), products[:p, p:][free] / unit[:, None]
    # Products of the residual and of the responses, after projecting out the parameters.
    projected = products[p:, p:] - across.T @ np.linalg.lstsq(within, across, rcond=None)[0]
    before, alone = float(projected[0, 0]), np.diag(projected)[1:]
    # A response that the parameters explain up to rounding has no defined size.
    squares = np.where(alone > _ROUNDING * np.diag(products)[p + 1 :], alone, np.inf)
    # The force is missing from the computed motion, so its residual has the opposite sign.
    sizes = -projected[0, 1:] / squares
    after = np.maximum(before + sizes * projected[0, 1:], 0.0)
    evidence = (before - after) * degrees - (thresholds.VERY_STRONG + np.log(residual.size * samples)) * after
    names = [names[int(size < 0)] for names, size in zip(forces, sizes, strict=True)]
    return [
        _Explained(names[i], float(sizes[i]), effects[:, i], before / degrees, float(after[i]) / degrees, degrees)
        for i in range(len(names))
        if names[i] and evidence[i] > 0
    ]


def discrepancy_covariance(discrepancies: Sequence[Discrepancy | None], parameters: int) -> np.ndarray:
    """Return the covariance to add for omitted forces, shape (p, p).

    If several runs omit the same force, their shifts add up.
    """
    shifts: dict[str, np.ndarray] = {}
    for discrepancy in filter(None, discrepancies):
        shifts[discrepancy.force] = shifts.get(discrepancy.force, 0.0) + discrepancy.shift
    return sum((np.outer(shift, shift) for shift in shifts.values()), np.zeros((parameters, parameters)))


def advice(
    problem: Problem, solution: Solution, covariance: Covariance, discrepancies: Sequence[Discrepancy | None]
) -> Iterator[str]:
    """Yield a sentence about the most significant omitted force."""
    discrepancy = max(filter(None, discrepancies), key=lambda each: each.seen, default=None)
    if discrepancy is None:
        return
    shift, errors = discrepancy.shift * solution.derived.slope, np.sqrt(np.diag(covariance.statistical))
    most = int(np.argmax(np.abs(shift) / np.where(errors > 0, errors, np.inf)))
    quantity, moved = problem.windows[discrepancy.run].motion, problem.parameters[most]
    by = f"{shift[most]:.2g} {rotary_unit(moved.unit, quantity)}".rstrip()
    names = [parameter.name for parameter in problem.parameters if "[" not in parameter.name]
    shared = [name for name in names if name.rsplit(".", 1)[-1] not in NUISANCES]
    force, how = _advice(discrepancy.force, shared, quantity)
    yield (
        f"{force} is detected ({discrepancy.seen:.3g} standard errors). Adding it would change {moved.name} by {by}; "
        f"the standard error includes this. Fit with {how}."
    )


def _advice(force: str, free: list[str], quantity: str) -> tuple[str, str]:
    """Return the name of a force, and the arguments that fit it."""
    if force == "damping":
        return "Viscous damping", f"free={[*free, 'damping']}"
    if force == "drag":
        return "Quadratic drag", f"free={[*free, 'drag']}"
    if force == "contact":
        return "A contact that deforms before it slides", "friction=Dahl(...) or friction=LuGre(...)"
    if force == "falling":
        return "Friction that falls with velocity", "friction=Stribeck(...)"
    if force == "softening" and quantity == "rad":
        return "The restoring force of a pendulum", "restoring=Pendulum()"
    spring = f"A spring that {force.removesuffix('ing')}s with deflection"
    return spring, f"restoring=Cubic(0.0) with free={[*free, 'k3']}"
