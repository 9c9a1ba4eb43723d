"""The reversals of a trace, refined to a fraction of its noise.

Dry friction makes the acceleration jump at each reversal: before it, spring and friction together brake the mass;
afterwards only their difference accelerates it. A trace is therefore not symmetric about a reversal. The fit gives each
side a separate curvature, and both share the time and the position at which the velocity is zero.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

ITERATIONS = 12
ROUGHLY = 0.05  # change, in half-widths of the window, at which the fit moves on to the next window
IMMATERIAL = 1e-4  # share of the standard error
TOGETHER = 256  # reversals refined at once, which bounds the memory
BINS = 128  # averages per window; less than 1 % of the information is lost
RIDGE = 1e-13  # relative to the squared norms; makes a side with fewer samples than terms solvable


def window(half_period: Any, amplitude: Any, noise: float, interval: float) -> np.ndarray:
    """Return the half-width [s] of the fit around an extreme.

    It balances truncation error and noise, and contains at least eight samples.
    """
    share = np.divide(noise, amplitude, out=np.zeros(np.shape(amplitude)), where=np.asarray(amplitude) > 0)
    width = np.maximum((1440.0 * share) ** (1.0 / 6.0) * half_period / np.pi, 8.0 * interval)
    return np.clip(width, 0.08 * half_period, 0.3 * half_period)


def order_for(smallest: Any, noise: float) -> np.ndarray:
    """Return the highest power of time in the fit of a reversal.

    It depends on the smaller of the two half-cycles that meet there.
    """
    return np.where(np.asarray(smallest) > 1e3 * noise, 4, 2)


def point_std(width: Any, order: Any, noise: float, interval: float) -> np.ndarray:
    """Return the standard error of the position of a reversal.

    It is the standard error of the mean of its window times 3/2, or times 5/2 for order four. These are the intercepts
    of least squares for the functions of `refine` with evenly spaced samples.
    """
    return np.where(np.asarray(order) == 4, 2.5, 1.5) * noise / np.sqrt(2 * np.asarray(width) / interval)


def refine(
    t: np.ndarray, x: np.ndarray, guess: Any, omega: Any, windows: Sequence[tuple[Any, Any]], before: str = "moving",
    after: str = "moving",
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Fit times and positions of reversals, stops or starts near guesses.

    Each is fitted separately.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
        guess: times of the extremes [s], accurate to about a third of the first width, shape `(k,)`, or one number.
        omega: angular frequency of the motion [rad/s], shape `(k,)`, or one number.
        windows: half-width of each window [s] and the highest power of time on a moving side there (2, 3 or 4), each of
            shape `(k,)` or one number. The result of each window is the guess for the next.
        before: state of the mass before the extreme: `"moving"` or `"still"`.
        after: state of the mass after it: `"moving"`, `"still"` or `"creeping"`.

    Returns:
        Times and positions, shape `(k,)`. If a window has too few samples or its fit diverges, its guess is returned.
    """
    guess, omega = np.broadcast_arrays(*np.atleast_1d(guess, omega))
    time, position = guess.astype(np.float64), np.empty(guess.size)
    for (width, order), enough in zip(windows, [ROUGHLY] * (len(windows) - 1) + [0.0], strict=True):
        width, order = np.broadcast_to(width, guess.shape), np.broadcast_to(order, guess.shape)
        for first in range(0, guess.size, TOGETHER):
            k = slice(first, first + TOGETHER)
            near = _windows(t, x, time[k], omega[k], width[k], order[k])
            shift, position[k] = _gauss_newton(near, enough, before, after)
            time[k] += shift * width[k]
    return time, position


class _Windows(NamedTuple):
    """Averages around several reversals, shape `(k, bins)`.

    Times count from the guess, in half-widths of the window. A bin is the average of neighbouring samples. Only the
    motion within a bin is lost, and with it less than 1 % of the information on the reversal.
    """

    time: np.ndarray
    variance: np.ndarray  # of the times within a bin
    value: np.ndarray  # position from the guessed one, times the weight
    weight: np.ndarray  # root of the number of samples in a bin
    phase: np.ndarray  # of a half-width [rad], shape `(k, 1)`
    order: np.ndarray  # highest power of time, shape `(k, 1)`
    guess: np.ndarray  # position at the guessed instant, shape `(k,)`
    size: np.ndarray  # number of samples, shape `(k,)`


def _windows(
    t: np.ndarray, x: np.ndarray, guess: np.ndarray, omega: np.ndarray, width: np.ndarray, order: np.ndarray
) -> _Windows:
    """Average the samples within `width` of each guess in equal bins."""
    # A bin is summed up to the first sample after it, which the last sample of a record does not have.
    low, high = np.searchsorted(t[:-1], [guess - width, guess + width])
    size, position = high - low, np.interp(guess, t, x)
    stride = np.maximum(-(-size // BINS), 1)
    bins = np.arange(np.max(-(-size // stride)) + 1)
    edges = low[:, None] + np.minimum(bins * stride[:, None], size[:, None])
    count, first, last = np.diff(edges), edges[:, :-1], np.maximum(edges[:, 1:] - 1, edges[:, :-1])
    used = slice(0, int(edges.max()) + 1)  # reduceat extends the last sum to the end
    sums = [np.add.reduceat(values[used], edges.ravel()).reshape(edges.shape)[:, :-1] for values in (t, x)]
    means, width, weight = [total / np.maximum(count, 1) for total in sums], width[:, None], np.sqrt(count)
    return _Windows(
        time=(means[0] - guess[:, None]) / width,
        # Exact for evenly spaced samples.
        variance=((t[last] - t[first]) / width) ** 2 / 12 * (count + 1) / np.maximum(count - 1, 1),
        value=(means[1] - position[:, None]) * weight,
        weight=weight,
        phase=omega[:, None] * width,
        order=np.where(size < 12, 2, order)[:, None],
        guess=position,
        size=size,
    )


def _gauss_newton(near: _Windows, enough: float, before: str, after: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the shift of each reversal, in half-widths, and its position.

    Failed fits return a shift of zero and the guessed position.
    """
    shift, offset, fitted = np.zeros(near.size.size), np.zeros(near.size.size), near.size >= 4
    active = np.flatnonzero(fitted)
    for _ in range(ITERATIONS if active.size else 0):
        part = near if active.size == shift.size else _Windows(*(values[active] for values in near))
        change, offset[active], immaterial = _step(part, shift[active], before, after)
        shift[active] += change
        fitted[active] = np.abs(shift[active]) <= 0.7
        active = active[fitted[active] & ~(immaterial | (np.abs(change) < enough))]
        if not active.size:
            break
    return np.where(fitted, shift, 0.0), near.guess + np.where(fitted, offset, 0.0)


def _step(near: _Windows, shift: np.ndarray, before: str, after: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute one Gauss-Newton step by a joint linear fit.

    Returns the change of the shift, the position, and True where the change is immaterial.
    """
    basis, slopes = _sides(near, shift, before, after)
    gram = basis @ basis.mT
    norm = np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
    norm = np.where(norm > 0, norm, 1.0)
    scale = norm[:, :, None] * norm[:, None, :]
    inverse = np.linalg.inv(gram / scale + RIDGE * np.identity(norm.shape[1])) / scale
    values = near.value[:, :, None]
    coefficients = inverse @ (basis @ values)
    residual = values - basis.mT @ coefficients
    sensitivity = -(slopes.mT @ coefficients)
    reduced = sensitivity - basis.mT @ (inverse @ (basis @ sensitivity))
    power = np.sum(reduced**2, axis=1)
    change = np.divide(np.sum(reduced * residual, axis=1), power, out=np.zeros_like(power), where=power > 0)
    change = np.clip(change, -0.25, 0.25)
    remainder = residual - sensitivity * change[:, :, None]
    offset = coefficients[:, :1] + inverse[:, :1] @ (basis @ remainder)
    # The next change would be of the order of this one squared; far below the standard error it is immaterial.
    error = np.sqrt(np.mean(remainder**2, axis=1) / np.where(power > 0, power, 1.0))
    immaterial = change**2 < np.maximum(IMMATERIAL * error, 1e-10)
    return change[:, 0], offset[:, 0, 0], immaterial[:, 0]


def _sides(near: _Windows, shift: np.ndarray, before: str, after: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the weighted basis functions and their slopes.

    The shape is `(k, functions, bins)`. Each side has a set of functions that are at rest at the reversal. To average a
    function over its bin, half the variance of the times times the second derivative is added.
    """
    time, variance, weight = near.time - shift[:, None], near.variance, near.weight
    sine, cosine = np.sin(0.5 * near.phase * time), np.cos(0.5 * near.phase * time)
    chord, square = 2.0 * sine / near.phase, time * time
    terms = [(chord * chord + variance * (cosine * cosine - sine * sine), 2.0 * chord * cosine)]
    higher = (time * (square + 3.0 * variance), 3.0 * square), (square * (square + 6.0 * variance), 4.0 * square * time)
    for power, (value, slope) in zip(range(3, int(near.order.max()) + 1), higher, strict=False):
        terms.append((value * (near.order >= power), slope * (near.order >= power)))
    columns, slopes = [weight], [np.zeros_like(weight)]
    for side, state in ((time < 0, before), (time >= 0, after)):
        if state == "still":
            continue
        share = weight * side
        for value, slope in [(time, 1.0)] if state == "creeping" else terms:
            columns.append(share * value)
            slopes.append(share * slope)
    return np.stack(columns, axis=1), np.stack(slopes, axis=1)
