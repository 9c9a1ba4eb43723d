"""Where a trace turns round: found coarsely by hysteresis, then refined to a fraction of the noise.

Dry friction makes the acceleration jump at each reversal, so a trace is not symmetric there: before the turn the mass
is braked by spring and friction together, after it by their difference. The refinement therefore gives each side its
own curvature, and shares only the instant and the position at which the velocity vanishes.
"""

import numpy as np

ITERATIONS = 12


def smooth(x: np.ndarray, width: int) -> np.ndarray:
    """Moving average over `width` samples (made odd), shorter towards both ends; a lone outlier is taken out before."""
    if width < 3:
        return x
    half = width // 2
    clean = np.concatenate([x[:1], np.median([x[:-2], x[1:-1], x[2:]], axis=0), x[-1:]])
    sums = np.concatenate([[0.0], np.cumsum(clean - clean.mean())])
    index = np.arange(x.size)
    reach = np.minimum(half, np.minimum(index, x.size - 1 - index))
    return (sums[index + reach + 1] - sums[index - reach]) / (2 * reach + 1) + clean.mean()


def zigzag(x: np.ndarray, threshold: float) -> list[int]:
    """Indices of alternating extremes between which `x` moves by more than `threshold`.

    The first is the pole from which the motion starts, the last the farthest point of the stroke still open at the end;
    the ones between are reversals. A trace that never moves by more than `threshold` gives an empty list.
    """
    pivots: list[int] = []
    high = low = 0
    direction = 0
    for i in _local_extremes(x):
        value = x[i]
        if value > x[high]:
            high = i
        if value < x[low]:
            low = i
        if direction >= 0 and x[high] - value > threshold:
            pivots.append(high)
            direction, low, high = -1, i, i
        elif direction <= 0 and value - x[low] > threshold:
            pivots.append(low)
            direction, low, high = 1, i, i
    return [*pivots, high if direction > 0 else low] if pivots else []


def _local_extremes(x: np.ndarray) -> list[int]:
    moves = np.flatnonzero(np.diff(x) != 0)
    signs = np.sign(np.diff(x)[moves])
    turns = moves[1:][signs[1:] != signs[:-1]]
    return [0, *turns.tolist(), x.size - 1]


def window(half_period: float, amplitude: float, noise: float, interval: float) -> float:
    """Half-width [s] of the fit around an extreme: truncation error and noise in balance, at least eight samples."""
    angle = (720.0 * 2.0 * noise / amplitude) ** (1.0 / 6.0) if amplitude > 0 else 0.0
    width = max(angle * half_period / np.pi, 8.0 * interval)
    return float(np.clip(width, 0.08 * half_period, 0.3 * half_period))


def refine(
    t: np.ndarray, x: np.ndarray, guess: float, omega: float, width: float, *, order: int = 4, before: str = "moving",
    after: str = "moving",
) -> tuple[float, float]:  # fmt: skip
    """Fits the instant and the position of a turn, stop or start near `guess`.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
        guess: time of the extreme, good to about a third of `width` [s].
        omega: angular frequency of the motion [rad/s].
        width: half-width of the fitted window [s].
        order: highest power of time on a moving side: 2, 3 or 4.
        before: what the mass does before the turn: `"moving"` or `"still"`.
        after: what it does afterwards: `"moving"`, `"still"` or `"creeping"`.

    Returns:
        Time and position of the turn. Where the window holds too few samples or the fit runs away: the guess.
    """
    low, high = np.searchsorted(t, [guess - width, guess + width])
    near, values = t[low:high], x[low:high]
    fallback = float(guess), float(np.interp(guess, t, x))
    if near.size < 4:
        return fallback
    order = min(order, 2 if near.size < 12 else order)
    instant = guess
    for _ in range(ITERATIONS):
        basis, slopes = _sides(omega * (near - instant), order, before, after)
        coefficients = np.linalg.lstsq(basis, values, rcond=None)[0]
        sensitivity = -omega * slopes @ coefficients
        joint = np.linalg.lstsq(np.column_stack([basis, sensitivity]), values - basis @ coefficients, rcond=None)[0]
        change = float(np.clip(joint[-1], -0.25 * width, 0.25 * width))
        instant += change
        if abs(instant - guess) > 0.7 * width:
            return fallback
        if abs(change) < 1e-10 * width:
            break
    basis, _ = _sides(omega * (near - instant), order, before, after)
    return float(instant), float(np.linalg.lstsq(basis, values, rcond=None)[0][0])


def _sides(phase: np.ndarray, order: int, before: str, after: str) -> tuple[np.ndarray, np.ndarray]:
    """Basis functions that start at the turn with zero velocity, one set per side, and their slopes in phase."""
    columns, slopes = [np.ones_like(phase)], [np.zeros_like(phase)]
    for side, state in ((phase < 0, before), (phase >= 0, after)):
        if state == "creeping":
            columns.append(np.where(side, phase, 0.0))
            slopes.append(np.where(side, 1.0, 0.0))
        if state != "moving":
            continue
        columns.append(np.where(side, 1.0 - np.cos(phase), 0.0))
        slopes.append(np.where(side, np.sin(phase), 0.0))
        for power in range(3, order + 1):
            columns.append(np.where(side, phase**power, 0.0))
            slopes.append(np.where(side, power * phase ** (power - 1), 0.0))
    return np.stack(columns, axis=1), np.stack(slopes, axis=1)
