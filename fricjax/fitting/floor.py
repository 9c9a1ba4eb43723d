"""The floor that shakes: how a kick of acceleration goes on through the half-cycles of a decay, to its stop.

Within a half-cycle a small deviation swings as the mass does. At a reversal friction turns round, and a mass that turns
later has less time to be accelerated back: with the accelerations a and b before and behind the reversal the deviation
of the velocity becomes b/a of itself, (X - f)/(X + f) for a dead band f at a distance X from the equilibrium. Where
friction rises towards the reversal, deviations shrink and grow again with the accelerations before and behind, so that
the dead band is that of sliding on either side. At the stop nothing is left of it, the deviation of the position stays,
and no further kick moves the mass.

Kicks have a colour for as long as that system is linear. The acceleration of a floor is not white: what Kalman's filter
for white kicks leaves still remembers, and goes through the filter of an autoregression. Towards the end of a decay
half-cycles become as short as what the kicks have added up to, reversals come early or late by much of a half-cycle,
and no linear system says what follows.
"""

import numpy as np

from ..estimation.autoregression import autoregression, innovations, spread_of, start_of
from ..estimation.colour import Colour, Series, white, whitened_columns
from ..estimation.process import StateTransition, filtered, kicks_of
from .problem import Problem
from .solve import Solution
from .window import equilibrium

# Rounds in which the kicks and the rows that show them come to agree. Of so few rows for each parameter the size of
# kicks is known no better than to a fifth, and none of them are left out.
_ROUNDS, _LEAST = 3, 32


def passage_of(problem: Problem, at: Solution, run: int, t: np.ndarray) -> StateTransition | None:
    """The passage of a deviation between times of a run; None where the record shows no half-cycles."""
    window, machine = problem.windows[run], at.derived.machine
    segmentation = window.segmentation
    if segmentation.turning_times.size < 2:
        return None
    start = float(problem.residual.run_parameters(at.derived.values, run)["t_release"])
    begin = min(start, float(t[0] - 1e-3 * (t[1] - t[0])))
    times = segmentation.turning_times - window.origin
    later = times > start + segmentation.half_period / 4
    reversals, swing = times[later], np.abs(segmentation.turning_points - equilibrium(segmentation))[later]
    band = float(machine.friction.dynamic_force(machine.normal_force)) / float(machine.stiffness)
    ratios = np.maximum((swing - band) / (swing + band), 0.0)
    if segmentation.rest is not None:
        reversals, ratios = np.append(reversals, segmentation.rest - window.origin), np.append(ratios, 0.0)
    edges = np.unique(np.concatenate([[begin], t, reversals]))
    half_cycle = np.searchsorted(reversals, edges[:-1], side="right")
    # The duration of each half-cycle serves springs of any shape.
    rates = np.pi / np.append(np.diff(np.concatenate([[begin], reversals])), segmentation.half_period)
    transitions, kicked = _steps(np.diff(edges), rates[half_cycle], float(machine.damping) / float(machine.mass))
    if segmentation.rest is not None:
        still = half_cycle == reversals.size
        transitions[still], kicked[still] = np.diag([1.0, 0.0]), 0.0
    # A reversal that comes late by the phase d/X, of a deviation d from a swing X, leaves an error f (d/X)^2.
    swings = np.append(swing, band)[np.minimum(np.searchsorted(reversals, t), swing.size)]
    # Without friction it leaves none, nor is there a swing that it would end.
    swings = np.maximum(swings, band)
    bend = np.divide(band, swings**2, out=np.zeros_like(swings), where=swings > 0)
    return _joined(t, edges, transitions, kicked, dict(zip(reversals, ratios, strict=True)))._replace(bend=bend)


def _joined(
    t: np.ndarray, edges: np.ndarray, transitions: np.ndarray, kicked: np.ndarray, reversals: dict[float, float]
) -> StateTransition:
    """The passage from row to row, of steps from edge to edge and of what reversals make of the velocity."""
    joined = StateTransition(np.empty((t.size, 2, 2)), np.empty((t.size, 2, 2)), np.zeros(t.size))
    so_far, spread, row = np.eye(2), np.zeros((2, 2)), 0
    for edge, step, kicks in zip(edges[1:], transitions, kicked, strict=True):
        so_far, spread = step @ so_far, step @ spread @ step.T + kicks
        if edge in reversals:
            reflection = np.diag([1.0, reversals[edge]])
            so_far, spread = reflection @ so_far, reflection @ spread @ reflection
        if row < t.size and edge == t[row]:
            joined.matrix[row], joined.noise[row] = so_far, spread
            so_far, spread, row = np.eye(2), np.zeros((2, 2)), row + 1
    return joined


def _steps(steps: np.ndarray, rates: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition of position and velocity over each step, and what kicks add to their covariance.

    Both by one exponential (Van Loan, IEEE Trans. Autom. Control 23, 395, 1978), worked out once for steps that are
    alike, which all are but those to and from a reversal.
    """
    from scipy.linalg import expm

    unit = steps.max()
    kinds, which = np.unique(np.round(np.stack([steps / unit, rates * unit]), 9), axis=1, return_inverse=True)
    both = np.zeros((kinds.shape[1], 4, 4))
    both[:, 0, 1], both[:, 1, 0], both[:, 1, 1] = -1.0, (kinds[1] / unit) ** 2, damping
    both[:, 2:, 2:] = -np.swapaxes(both[:, :2, :2], 1, 2)
    both[:, 1, 3] = 1.0
    grown = np.asarray(expm(both * (kinds[0] * unit)[:, None, None]))
    transitions = np.swapaxes(grown[:, 2:, 2:], 1, 2)
    which = which.ravel()
    return transitions[which], (transitions @ grown[:, :2, 2:])[which]


def first_rows(series: Series, n: int) -> Series:
    """The first rows of a series."""
    t, residual, slopes, unit, starts, rounding = series
    return Series(t[:n], residual[:n], slopes[:n], unit[:n], starts[starts < n], rounding[:n])


def kicked(series: Series, transition: StateTransition) -> Colour:
    """The colour of kicks of a linear system, beside independent noise, seen in the rows for which it is linear.

    How far these reach follows from the kicks.
    """
    colour = kicked_until(series, transition, series.t.size)
    for _ in range(_ROUNDS):
        last = colour.last
        if last is None or last <= _LEAST * series.slopes.shape[1]:
            break
        colour = kicked_until(series, transition, last)
        if colour.last == last:
            break
    return colour


def kicked_until(series: Series, transition: StateTransition, rows: int) -> Colour:
    """The same, seen in so many of the first rows.

    Kicks that are not white leave innovations that remember, and these are whitened by a process of their own.
    """
    part, passage = first_rows(series, rows), transition.first(rows)
    kicks, std, _, sizes, sides = kicks_of(part.residual, part.slopes, part.unit, passage)
    left = series.residual + series.slopes @ sizes
    _, (variances,) = filtered(np.zeros((series.t.size, 1)), series.unit, transition, np.array([kicks]))
    spread = float(np.sum(np.log(variances)))
    colour = white(series, std**2)._replace(left=left, kicks=kicks, spread=spread, transition=transition, sides=sides)
    begin, moving = np.zeros(1, int), passage.moving
    shaken = whitened_columns(left[:, None], series, colour)[:moving]
    shape, _ = autoregression(shaken[:, 0], begin)
    # One that is not stationary says nothing of its first rows, which the rest of the package counts on.
    if shape.size and start_of(shape).size:
        size = float(np.std(innovations(shaken, begin, shape)))
        more = spread_of(shape, begin, moving) + 2 * moving * np.log(size)
        colour = colour._replace(shape=shape, shape_std=size, spread=spread + more)
    return colour._replace(last=_as_far_as_linear(series, colour, transition, variances))


def _as_far_as_linear(series: Series, colour: Colour, transition: StateTransition, variances: np.ndarray) -> int | None:
    """Number of rows in which the error of the linear system is below an innovation; None for all."""
    deviation = colour.kicks * colour.std**2 * transition.deviations()
    beyond = transition.bend * deviation * series.unit > colour.std * np.sqrt(variances) * colour.shape_std
    return int(np.argmax(beyond)) if beyond.any() else None
