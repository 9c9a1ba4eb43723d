"""What a model lacks, as the motion that it leaves in the residuals tells.

The response of the motion to a force that the model has not (:mod:`.responses`) is sought in the residuals beside the
free parameters, in two ways. Where it explains what is left down to noise that forgets within a few samples, that is no
noise that remembers for longer, nor a floor that shakes, for these are another thing in every half-cycle. And where it
is seen beside noise that is known, fitting the force would move the parameters, which their standard errors must allow
for.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.colour import whitened
from ..estimation.covariance import Covariance
from ..show import rotary_unit
from .colours import by_kicks
from .names import NUISANCES
from .problem import Problem
from .responses import Responses, responses
from .rows import Rows, Seen
from .solve import Solution

# Part of the square of a response that rounding leaves of one that parameters explain.
_ROUNDING = 1e-10
# Part of the mean square beyond noise that a force must take away to be what the model lacks above all. Convention:
# of a large swing that bends the linear response explains two thirds.
_HALF = 0.5


class Lacking(NamedTuple):
    """A force that the model lacks.

    Attributes:
        run: number of the run that shows it.
        force: its name, of those of `responses`.
        seen: its size in standard errors.
        shift: how far fitting it would move the coordinates of the free parameters, shape (p,).
    """

    run: int
    force: str
    seen: float
    shift: np.ndarray


class _Explained(NamedTuple):
    """What a force explains.

    Attributes:
        force: its name.
        size: that of its response; `effect`: that response in the residuals, shape (rows,).
        before, after: mean squares of what the parameters leave, and of what the force leaves besides.
        degrees: of freedom of the latter.
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

    def lacking(self, run: int, slopes: np.ndarray, inverse: np.ndarray) -> Lacking:
        """The force that a run lacks; its derivatives by the coordinates, and the inverse of all normal equations."""
        return Lacking(run, self.force, self.seen, -self.size * inverse @ (slopes.T @ self.effect))


def responses_in(problem: Problem, at: Solution, run: int, rows: Rows) -> Responses:
    """The responses of a run to forces that its model has not, if it may lack any, at the times of its rows."""
    if problem.made:
        return Responses((), np.zeros((rows.series.t.size, 0)), 0)
    kinds = {parameter.kind for parameter in problem.parameters}
    return responses(problem.windows[run], at.derived, kinds, rows.series.t)


def explaining(problem: Problem, solution: Solution, run: int, rows: Rows, known: Responses) -> Lacking | None:
    """The force that explains what a run shows in motion down to noise of short memory; None where none does.

    Kicks of a floor add up, so that neighbouring half-cycles deviate alike, and a force may explain most of that by
    chance: beside kicks some force must be seen too.
    """
    forces = main_forces(problem, solution, run, rows, known)
    best = next((force for force, chance in forces if chance < thresholds.RARE), None)
    shaken = by_kicks(problem, solution, run, rows) if best is not None and problem.noise == "auto" else None
    if shaken is not None and seen_beside_noise(problem, solution, run, shaken, known) is None:
        return None
    return best


def main_forces(
    problem: Problem, solution: Solution, run: int, rows: Rows, known: Responses
) -> Iterator[tuple[Lacking, float]]:
    """The forces that take away most of what a run shows in motion beyond noise, the best one first.

    Each comes with the probability that it does so by chance.
    """
    if not known.forces:
        return
    series, p = rows.series, problem.residual.n_parameters
    moving = series.t <= problem.windows[run].stopped
    slopes, residual = series.slopes[moving, :p] * ~solution.shape.at_bound, series.residual[moving]
    effects = known.effects[moving] * series.unit[moving, None]
    # Of noise the second differences of neighbouring rows are large, of a motion they are not.
    noise = float(np.mean(np.diff(residual, n=2) ** 2)) / 6
    # A half-cycle on a floor that shakes has two numbers of its own, an amplitude and a phase.
    independent = 2 * known.half_cycles - int(np.count_nonzero(np.any(slopes, axis=0))) - 1
    forces = _seen(known.forces, effects, residual, slopes, rows.samples)
    for force in sorted(forces, key=lambda force: force.after):
        excess, left = max(force.before - noise, 0.0), max(force.after - noise, 0.0)
        if left < _HALF * excess:
            chance = _chance(excess, left, independent) * len(known.forces) if independent > 0 else 1.0
            yield force.lacking(run, slopes, solution.shape.inverse), chance


def _chance(excess: float, left: float, independent: int) -> float:
    """Probability that a curve explains as much of so many independent numbers by chance (F test)."""
    # Imported by the few fits that need it: it takes longer than all of this module does.
    from scipy.special import fdtrc

    return float(fdtrc(1, independent, (excess - left) * independent / max(left, np.finfo(float).tiny)))


def seen_beside_noise(problem: Problem, at: Solution, run: int, seen: Seen, known: Responses) -> Lacking | None:
    """The force that is seen the most surely beside the noise of a run; None where none is.

    Args:
        problem: the problem.
        at: its solution, whose quadratic form counts by the noise.
        run: number of the run.
        seen: its rows and their noise.
        known: the responses to forces at the times of these rows.
    """
    if not known.forces:
        return None
    series, p = seen.rows.series, problem.residual.n_parameters
    together = np.column_stack([series.slopes[:, :p] * ~at.shape.at_bound, known.effects * series.unit[:, None]])
    residual, columns = whitened(series._replace(slopes=together), seen.colour)
    forces = _seen(known.forces, columns[:, p:], residual, columns[:, :p], seen.rows.samples)
    best = max(forces, key=lambda force: force.seen, default=None)
    return None if best is None else best.lacking(run, columns[:, :p], at.shape.inverse)


def _seen(
    forces: Sequence[tuple[str, str]], effects: np.ndarray, residual: np.ndarray, slopes: np.ndarray, samples: int
) -> list[_Explained]:
    """The forces for which there is very strong evidence beside the parameters, of those that can have their sign.

    Args:
        forces: their names.
        effects: their responses, shape (rows, forces).
        residual: shape (rows,).
        slopes: its derivatives by the parameters, shape (rows, p).
        samples: number of samples in a row, all of which count in Schwarz's criterion.
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
    # Products of the residual and of the responses with what the parameters leave of them.
    beside = products[p:, p:] - across.T @ np.linalg.lstsq(within, across, rcond=None)[0]
    before, alone = float(beside[0, 0]), np.diag(beside)[1:]
    # Of a response that the parameters explain but for rounding no size is known.
    squares = np.where(alone > _ROUNDING * np.diag(products)[p + 1 :], alone, np.inf)
    # The computed motion lies where the force has not taken it.
    sizes = -beside[0, 1:] / squares
    after = np.maximum(before + sizes * beside[0, 1:], 0.0)
    evidence = (before - after) * degrees - (thresholds.VERY_STRONG + np.log(residual.size * samples)) * after
    names = [names[int(size < 0)] for names, size in zip(forces, sizes, strict=True)]
    return [
        _Explained(names[i], float(sizes[i]), effects[:, i], before / degrees, float(after[i]) / degrees, degrees)
        for i in range(len(names))
        if names[i] and evidence[i] > 0
    ]


def allowed_for(lacks: Sequence[Lacking | None], parameters: int) -> np.ndarray:
    """What is to be added to the covariance of the coordinates, shape (p, p), for forces that are lacking.

    Of several runs that lack the same the shifts add up.
    """
    shifts: dict[str, np.ndarray] = {}
    for lack in filter(None, lacks):
        shifts[lack.force] = shifts.get(lack.force, 0.0) + lack.shift
    return sum((np.outer(shift, shift) for shift in shifts.values()), np.zeros((parameters, parameters)))


def advice(
    problem: Problem, solution: Solution, covariance: Covariance, lacks: Sequence[Lacking | None]
) -> Iterator[str]:
    """A sentence on what is lacking the most surely, what it would move, and how it is fitted."""
    lack = max(filter(None, lacks), key=lambda each: each.seen, default=None)
    if lack is None:
        return
    shift, errors = lack.shift * solution.derived.slope, np.sqrt(np.diag(covariance.statistical))
    most = int(np.argmax(np.abs(shift) / np.where(errors > 0, errors, np.inf)))
    quantity, moved = problem.windows[lack.run].quantity, problem.parameters[most]
    by = f"{shift[most]:.2g} {rotary_unit(moved.unit, quantity)}".rstrip()
    names = [parameter.name for parameter in problem.parameters if "[" not in parameter.name]
    shared = [name for name in names if name.rsplit(".", 1)[-1] not in NUISANCES]
    what, how = _advice(lack.force, shared, quantity)
    yield (
        f"{what} would move {moved.name} by {by}, for which its standard error allows; it is seen by {lack.seen:.3g} "
        f"standard errors. Fit with {how}."
    )


def _advice(force: str, free: list[str], quantity: str) -> tuple[str, str]:
    """What is lacking, and how it is fitted."""
    if force == "damping":
        return "A viscous damping", f"free={[*free, 'damping']}"
    if force == "drag":
        return "A drag with the square of the speed", f"free={[*free, 'drag']}"
    if force == "contact":
        return "A contact that bends before it slides", "friction=Dahl(...) or friction=LuGre(...)"
    if force == "falling":
        return "Friction that falls with velocity", "friction=Stribeck(...)"
    if force == "softening" and quantity == "rad":
        return "The restoring force of a pendulum", "restoring=Pendulum()"
    spring = f"A spring that {force.removesuffix('ing')}s with deflection"
    return spring, f"restoring=Cubic(0.0) with free={[*free, 'k3']}"
