"""Velocity and acceleration of a stroke by local polynomials (Savitzky and Golay 1964).

A polynomial of fourth degree is fitted to the samples around each instant. The window is as long as the noise asks for
and as short as the motion allows: near a reversal, where the velocity scale of friction lies, it is short, and it grows
with the distance from it. No window reaches over an end of the stroke; next to an end it becomes one-sided. All of it
is linear in the samples, so the noise of any mean of the results follows exactly.
"""

import dataclasses
import functools
from typing import Any

import numpy as np

from .decay import Stroke

DEGREE = 4
SHORTEST = 4  # half-width in samples
REACH = 0.5  # half-width of a window, of its distance from the end of the stroke
GROWTH = 1.25  # from one window length to the next
# Second derivative of a quartic fit to 2 h + 1 samples at unit spacing: its noise is this over h^2.5, and the sixth
# derivative biases it by this times h^4.
NOISE_FACTOR = 16.5
BIAS_FACTOR = 1 / 770


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """A smoothed stroke.

    Attributes:
        stroke: its samples.
        x, v, a: position [m], velocity [m/s] and acceleration [m/s^2], shape (n,).
        operators: sparse matrices, shape (n, n), that make x, v and a of the samples.
    """

    stroke: Stroke
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    operators: tuple[Any, Any, Any]

    def std(self, weights: tuple[Any, Any, Any]) -> np.ndarray:
        """Standard deviation of the sum of x, v and a with the given weights at each sample, shape (n,)."""
        x, v, a = (_rows(w) @ operator for w, operator in zip(weights, self.operators, strict=True))
        combined = x + v + a
        return self.stroke.noise * np.sqrt(np.asarray(combined.multiply(combined).sum(axis=1)).ravel())

    def response(self, weights: tuple[Any, Any, Any]) -> Any:
        """What weights of x, v and a, each of shape (n, ...), weigh the samples with: sums of both are the same."""
        x, v, a = (operator.T @ w for w, operator in zip(weights, self.operators, strict=True))
        return x + v + a


def smooth(
    stroke: Stroke, shortest: float | None = None, *, acceleration: float = 0.0, lengthened: float = 1.0
) -> Motion:
    """Position, velocity and acceleration of one stroke.

    Args:
        stroke: its samples, evenly spaced.
        shortest: length of the shortest window [s]; None: the noise of acceleration is a fiftieth of `acceleration`.
        acceleration: deceleration by friction alone [m/s^2].
        lengthened: factor on the lengths of all windows.
    """
    narrow, wide = _half_widths(stroke, shortest, acceleration, lengthened)
    operators = _operators(stroke.t.size, narrow, wide, lengthened * REACH)
    scaled = tuple(operator / stroke.step**k for k, operator in enumerate(operators))
    return Motion(stroke, *(operator @ stroke.x for operator in scaled), scaled)  # type: ignore[arg-type]


def _half_widths(stroke: Stroke, shortest: float | None, acceleration: float, lengthened: float) -> tuple[int, int]:
    """Half-widths of the shortest and the longest window in samples."""
    phase = np.pi * stroke.step / (stroke.end - stroke.begin)
    relative = stroke.noise / (np.ptp(stroke.x) / 2)
    # Bias is a tenth of the noise where (phase h)^4 / 770 = 0.1 * 16.5 relative / (phase^2 h^2.5).
    wide = (0.1 * NOISE_FACTOR / BIAS_FACTOR * relative / phase**6) ** (1 / 6.5)
    wanted = 0.02 * acceleration * stroke.step**2 / stroke.noise
    narrow = (NOISE_FACTOR / wanted) ** 0.4 if shortest is None else shortest / stroke.step / 2
    largest = (stroke.t.size - 1) // 4
    narrow = int(np.clip(round(lengthened * narrow), SHORTEST, largest))
    return narrow, int(np.clip(round(lengthened * wide), narrow, largest))


@functools.lru_cache(maxsize=64)
def _operators(n: int, narrow: int, wide: int, reach: float) -> tuple[Any, Any, Any]:
    """Sparse matrices, shape (n, n), for the value and the first two derivatives at unit spacing."""
    from scipy.sparse import csr_array

    half, first = _windows(n, narrow, wide, reach)
    columns = np.concatenate([np.arange(a, a + 2 * h + 1) for a, h in zip(first, half, strict=True)])
    starts = np.concatenate([[0], np.cumsum(2 * half + 1)])
    place = np.arange(n) - first
    kernels = {int(h): _kernels(int(h), np.unique(place[half == h])) for h in np.unique(half)}
    rows = list(zip(half.tolist(), place.tolist(), strict=True))
    values = [np.concatenate([kernels[h][at][k] for h, at in rows]) for k in range(3)]
    return tuple(csr_array((v, columns, starts), shape=(n, n)) for v in values)  # type: ignore[return-value]


def _kernels(half: int, places: np.ndarray) -> dict[int, np.ndarray]:
    """Coefficients for value and derivatives at some places of a window, each of shape (3, 2 half + 1), by place."""
    from scipy.signal import savgol_coeffs

    size = 2 * half + 1
    return {
        int(at): np.array([savgol_coeffs(size, DEGREE, k, pos=int(at), use="dot") for k in range(3)]) for at in places
    }


def _windows(n: int, narrow: int, wide: int, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Half-width and first sample of the window of each sample."""
    index = np.arange(n)
    distance = np.minimum(index, n - 1 - index)
    levels = np.unique(np.append(np.geomspace(narrow, wide, _levels(narrow, wide)).astype(int), narrow))
    half = levels[np.searchsorted(levels, np.clip(reach * distance, narrow, wide), side="right") - 1]
    return half, np.clip(index - half, 0, n - 1 - 2 * half)


def _levels(narrow: int, wide: int) -> int:
    return 1 + max(1, round(np.log(wide / narrow) / np.log(GROWTH)))


def _rows(weights: Any) -> Any:
    """A diagonal matrix of weights."""
    from scipy.sparse import diags_array

    return diags_array(weights)
