"""Propagation of floor vibration through the half-cycles of a decay.

Within a half-cycle a small deviation oscillates like the mass. At a reversal friction changes sign, and a mass that
turns later has less time to accelerate back. With the accelerations a and b before and after the reversal, the
deviation of the velocity is multiplied by b/a, which is (X - f)/(X + f) for a dead band f at a distance X from the
equilibrium. If friction rises towards the reversal, deviations shrink and grow again with the accelerations on both
sides, so f is the dead band of sliding. At the stop the deviation of the velocity vanishes, that of the position stays,
and later kicks do not move the mass.

The acceleration of a floor is not white: the innovations of the Kalman filter for white kicks are still correlated, and
an autoregressive filter whitens them. This works as long as the system is linear. Towards the end of a decay the
half-cycles become as short as the accumulated deviation; reversals then shift by much of a half-cycle, and no linear
system describes the motion.
"""

import numpy as np

from ..estimation.autoregression import autoregression, innovations, spread_of, start_of
from ..estimation.colour import Colour, Series, white, whitened_columns
from ..estimation.process import StateTransition, filtered, kicks_of
from .problem import Problem
from .solve import Solution
from .window import equilibrium

# Iterations for the size of the kicks and the rows that determine it, and the fewest rows per parameter. With this few
# rows the size is known to a fifth, and no row is dropped.
_ROUNDS, _LEAST = 3, 32


def passage_of(problem: Problem, at: Solution, run: int, t: np.ndarray) -> StateTransition | None:
    """Return the state transitions between times of a run.

    It is None without half-cycles, and for a reading that is not the displacement: the model reads the first state.
    """
    window, machine = problem.windows[run], at.derived.machine
    segmentation = window.segmentation
    if segmentation.turning_times.size < 2 or window.observation.kind != "displacement":
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
    # The duration of each half-cycle is correct for nonlinear springs too.
    rates = np.pi / np.append(np.diff(np.concatenate([[begin], reversals])), segmentation.half_period)
    transitions, kicked = _steps(np.diff(edges), rates[half_cycle], float(machine.damping) / float(machine.mass))
    if segmentation.rest is not None:
        still = half_cycle == reversals.size
        transitions[still], kicked[still] = np.diag([1.0, 0.0]), 0.0
    # A reversal delayed by the phase d/X, for a deviation d and an amplitude X, causes an error f (d/X)^2.
    swings = np.append(swing, band)[np.minimum(np.searchsorted(reversals, t), swing.size)]
    # Without friction there is no such error, and no amplitude at which the motion would end.
    swings = np.maximum(swings, band)
    bend = np.divide(band, swings**2, out=np.zeros_like(swings), where=swings > 0)
    return _joined(t, edges, transitions, kicked, dict(zip(reversals, ratios, strict=True)))._replace(bend=bend)


def _joined(
    t: np.ndarray, edges: np.ndarray, transitions: np.ndarray, kicked: np.ndarray, reversals: dict[float, float]
) -> StateTransition:
    """Combine the transitions between edges and at reversals into one per row."""
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
    """Return the transition matrix and the noise covariance of each step.

    Both follow from one matrix exponential (Van Loan, IEEE Trans. Autom. Control 23, 395, 1978). It is computed once
    for equal steps; only steps to and from reversals differ.
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
    """Return the first `n` rows of a series."""
    t, residual, slopes, unit, starts, rounding = series
    return Series(t[:n], residual[:n], slopes[:n], unit[:n], starts[starts < n], rounding[:n])


def fit_floor_noise(series: Series, transition: StateTransition) -> Colour:
    """Return the noise model of a floor: kicks and white reading noise.

    It uses the rows for which the system is linear; their number follows from the kicks.
    """
    colour = fit_floor_noise_until(series, transition, series.t.size)
    for _ in range(_ROUNDS):
        last = colour.last
        if last is None or last <= _LEAST * series.slopes.shape[1]:
            break
        colour = fit_floor_noise_until(series, transition, last)
        if colour.last == last:
            break
    return colour


def fit_floor_noise_until(series: Series, transition: StateTransition, rows: int) -> Colour:
    """Return the same noise model from the first `rows` rows.

    If kicks are not white, their innovations are correlated. An autoregressive process whitens them.
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
    # A process that is not stationary has no distribution of its first rows, which other functions need.
    if shape.size and start_of(shape).size:
        size = float(np.std(innovations(shaken, begin, shape)))
        more = spread_of(shape, begin, moving) + 2 * moving * np.log(size)
        colour = colour._replace(shape=shape, shape_std=size, spread=spread + more)
    return colour._replace(last=_as_far_as_linear(series, colour, transition, variances))


def _as_far_as_linear(series: Series, colour: Colour, transition: StateTransition, variances: np.ndarray) -> int | None:
    """Return how many rows have a small linearisation error.

    The error is small if it is below the standard deviation of an innovation. None means all rows.
    """
    deviation = colour.kicks * colour.std**2 * transition.deviations()
    beyond = transition.bend * deviation * series.unit > colour.std * np.sqrt(variances) * colour.shape_std
    return int(np.argmax(beyond)) if beyond.any() else None
