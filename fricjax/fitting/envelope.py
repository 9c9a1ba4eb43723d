"""Start values of a pendulum from angles and times of its reversals.

Over a half-cycle between the angles x_n and x_{n+1} the energy per unit inertia and per squared angular frequency,
``u = 1 - cos x``, falls by

    u_n - u_{n+1} = (f/omega^2) |x_n - x_{n+1}| + (c/omega) int w |dx| + q int w^2 |dx|,

with dry friction f, damping c and drag q per unit inertia and the speed ``v = omega w``. Its duration is
``(1/omega) int |dx|/w``. The integrals hold for large angles: ``w^2/2`` is the energy above the potential. The
coefficients of the previous iteration determine how the loss is distributed over the half-cycle. Summed from the first
reversal, both equations are linear in the unknowns, and each reading error enters only once. Weighted least squares
give friction, damping, drag and offset from the angles, and omega from the times, nearly as accurately as a fit of the
whole record.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..data import Segmentation
from .window import equilibrium

# Points of the midpoint rule over a half-cycle. Beyond 3.1 rad its poles are 0.2 from the ends: error exp(-2 64 0.2).
_POINTS = 64
_PHASE = np.pi * (np.arange(_POINTS) + 0.5) / _POINTS
# Matrix from values at these points to integrals up to each of them, by a cosine series.
_RANKS = np.arange(1, _POINTS)
_INTEGRATION = (
    _PHASE[None, :] + 2 * np.cos(np.outer(_PHASE, _RANKS)) @ (np.sin(np.outer(_RANKS, _PHASE)) / _RANKS[:, None])
) / _POINTS
# Fewest reversals for which the envelope is better than the mean half-cycle.
FEWEST = 6
# Each iteration reduces an error by the fraction of the energy lost in a half-cycle.
_ROUNDS = 5
# Iterations for the distribution of the loss. Near the top the first half-cycles are slow, so early losses matter.
_SPREADS = 6
# Slope of the energy below which all readings have equal weights: there the model error exceeds the reading error.
_LEAST_SLOPE = 0.02
# Huber's bound in standard deviations, for reversals with wrong readings.
_OUTLYING = 3.0
TERMS = ("friction", "damping", "drag")


class Envelope(NamedTuple):
    """Angular frequency [rad/s], f/omega^2, c/omega, q, and loss per radian.

    Symbols are those of the module docstring; the loss is that of u.
    """

    omega: float
    friction: float
    damping: float
    drag: float
    loss: float


class _Reversals(NamedTuple):
    """Times [s], angles [rad] and centre [rad] of one record's reversals."""

    t: np.ndarray
    x: np.ndarray
    offset: float


def envelope(decays: Sequence[Segmentation], fixed: Mapping[str, float], lower: Mapping[str, float]) -> Envelope | None:
    """Estimate the coefficients of a pendulum; None if reversals are too few.

    Args:
        decays: segmentations of records of one pendulum.
        fixed: known values of friction, damping and drag per unit inertia, and of "omega", by name.
        lower: least value of each of the others, per unit inertia.
    """
    runs = [run for run in map(_reversals, decays) if run.t.size >= FEWEST]
    if not runs:
        return None
    estimate = Envelope(0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(_ROUNDS):
        integrals = [_integrals(run, estimate) for run in runs]
        omega = fixed.get("omega") or _frequency(runs, [columns[0] for columns in integrals])
        if not (np.isfinite(omega) and omega > 0):
            return None
        units = {"friction": omega**-2, "damping": 1 / omega, "drag": 1.0}
        known, least = (
            {name: table[name] * units[name] for name in TERMS if name in table} for table in (fixed, lower)
        )
        losses, offsets = _losses(runs, [columns[1:] for columns in integrals], known, least)
        estimate = Envelope(omega, losses[0], losses[1], losses[2], _mean_loss(runs, integrals))
        runs = [run._replace(offset=run.offset + change) for run, change in zip(runs, offsets, strict=True)]
    return estimate if np.all(np.isfinite(estimate)) else None


def _reversals(segmentation: Segmentation) -> _Reversals:
    """Return the reversals up to the first that stays on one side.

    They must lie within a half-turn of the centre.
    """
    x, offset = segmentation.turning_points, equilibrium(segmentation)
    same = np.flatnonzero((x[1:] - offset) * (x[:-1] - offset) >= 0)
    kept = slice(0, int(same[0]) + 1 if same.size else x.size)
    inside = np.all(np.abs(x[kept] - offset) < np.pi)
    return _Reversals(segmentation.turning_times[kept], x[kept], offset) if inside else _Reversals(x[:0], x[:0], offset)


def _integrals(run: _Reversals, last: Envelope) -> tuple[np.ndarray, ...]:
    """Return the integrals of 1/w, 1, w and w^2 to each reversal.

    The first one is the duration times omega.
    """
    x = run.x - run.offset
    begin, end = x[:-1, None], x[1:, None]
    half, share = np.abs(begin - end) / 2, (1 - np.cos(_PHASE)) / 2
    potential = 2 * np.sin((begin + (end - begin) * share) / 2) ** 2
    first, lost = 2 * np.sin(begin / 2) ** 2, 2 * np.sin(begin / 2) ** 2 - 2 * np.sin(end / 2) ** 2
    step = half * np.sin(_PHASE)
    spread = np.broadcast_to(share, potential.shape)
    for _ in range(_SPREADS):
        w = np.sqrt(np.maximum(2 * (first - lost * spread - potential), 1e-12))
        force = last.friction + last.damping * w + last.drag * w**2
        total = np.pi * np.mean(force * step, axis=1, keepdims=True)
        if np.all(total > 0):
            spread = force * step @ _INTEGRATION / total
    means = (np.pi * np.mean(step * power, axis=1) for power in (1 / w, w, w**2))
    elapsed, by_speed, by_square = means
    columns = elapsed, 2 * half[:, 0], by_speed, by_square
    return tuple(np.append(0.0, np.cumsum(column)) for column in columns)


def _frequency(runs: Sequence[_Reversals], elapsed: Sequence[np.ndarray]) -> float:
    """Return the angular frequency by regression of times on summed durations.

    Each record has its own start time; small swings weigh less.
    """
    x = np.concatenate([run.x - run.offset for run in runs])
    weight = np.maximum(np.abs(np.sin(x)), _LEAST_SLOPE)
    columns = [np.concatenate(list(elapsed)), *_blocks(runs, [np.ones(run.t.size) for run in runs])]
    solution = _robust(np.stack(columns, axis=1), np.concatenate([run.t - run.t[0] for run in runs]), weight, {})
    return float(1 / solution[0])


def _losses(
    runs: Sequence[_Reversals],
    integrals: Sequence[Sequence[np.ndarray]],
    known: Mapping[str, float],
    lower: Mapping[str, float],
) -> tuple[list[float], np.ndarray]:
    """Return friction, damping, drag, and the offset correction of each record."""
    x = [run.x - run.offset for run in runs]
    fallen = np.concatenate([2 * np.sin(y[0] / 2) ** 2 - 2 * np.sin(y / 2) ** 2 for y in x])
    summed = {name: np.concatenate(parts) for name, parts in zip(TERMS, zip(*integrals, strict=True), strict=True)}
    fallen = fallen - sum(known[name] * summed[name] for name in known)
    sought = [name for name in TERMS if name not in known]
    # A larger offset lowers the energy at an angle y by its slope, and raises the energy lost so far.
    slopes = [-np.sin(y) for y in x]
    columns = [summed[name] for name in sought] + _blocks(runs, slopes) + _blocks(runs, [np.ones(y.size) for y in x])
    bounds = {i: lower.get(name, -np.inf) for i, name in enumerate(sought)}
    weight = 1 / np.maximum(np.abs(np.concatenate(slopes)), _LEAST_SLOPE)
    solution = _robust(np.stack(columns, axis=1), fallen, weight, bounds)
    losses = {**known, **dict(zip(sought, solution, strict=False))}
    return [float(losses[name]) for name in TERMS], solution[len(sought) : len(sought) + len(runs)]


def _mean_loss(runs: Sequence[_Reversals], integrals: Sequence[Sequence[np.ndarray]]) -> float:
    fallen = sum(float(np.cos(run.x[-1] - run.offset) - np.cos(run.x[0] - run.offset)) for run in runs)
    return max(fallen, 0.0) / sum(float(columns[1][-1]) for columns in integrals)


def _blocks(runs: Sequence[_Reversals], values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return one column per record, which is zero for other records."""
    return [
        np.concatenate([values[j] if i == j else np.zeros(run.t.size) for j, run in enumerate(runs)])
        for i in range(len(runs))
    ]


def _robust(columns: np.ndarray, wanted: np.ndarray, weight: np.ndarray, lower: Mapping[int, float]) -> np.ndarray:
    """Solve weighted least squares with lower bounds and Huber weights."""
    trust = np.ones(wanted.size)
    solution = np.zeros(columns.shape[1])
    for _ in range(3):
        solution = _bounded(columns, wanted, weight * np.sqrt(trust), lower)
        off = np.abs(weight * (wanted - columns @ solution))
        scale = 1.4826 * float(np.median(off))
        trust = np.minimum(1.0, _OUTLYING * scale / np.maximum(off, 1e-300)) if scale > 0 else trust
    return solution


def _bounded(columns: np.ndarray, wanted: np.ndarray, weight: np.ndarray, lower: Mapping[int, float]) -> np.ndarray:
    """Solve least squares with lower bounds, by fixing the worst violation repeatedly."""
    size = np.maximum(np.linalg.norm(columns * weight[:, None], axis=0), 1e-300)
    scaled = columns * weight[:, None] / size
    fixed: dict[int, float] = {}
    while True:
        free = [i for i in range(columns.shape[1]) if i not in fixed]
        rest = weight * wanted - sum((scaled[:, i] * value for i, value in fixed.items()), start=np.zeros(wanted.size))
        part = np.linalg.lstsq(scaled[:, free], rest, rcond=None)[0]
        below = {i: value - lower[i] * size[i] for i, value in zip(free, part, strict=True) if i in lower}
        worst = min(below, key=below.__getitem__, default=None)
        if worst is None or below[worst] >= 0:
            break
        fixed[worst] = lower[worst] * size[worst]
    solution = np.zeros(columns.shape[1])
    solution[free] = part
    for i, value in fixed.items():
        solution[i] = value
    return solution / size
