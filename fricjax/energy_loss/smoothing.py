"""Velocity and acceleration by local polynomials (Savitzky and Golay 1964).

A polynomial of fourth degree is fitted to the samples around each time. The noise sets the length of the window. It is
short near a reversal, where friction varies most with velocity, and grows with the distance from it. Windows never
extend over a reversal; next to one they become one-sided. All results are linear in the samples, so their noise follows
exactly.
"""

import dataclasses
import functools
from typing import Any

import numpy as np

from .decay import HalfCycle

DEGREE = 4
# Shortest half-width [samples]: nine samples for the five coefficients.
SHORTEST = 4
# Half-width of a window, relative to its distance from the reversal.
REACH = 0.5
# Ratio of successive window lengths. Few lengths need few sets of coefficients.
GROWTH = 1.25
# For the second derivative of a quartic fit to 2 h + 1 samples at unit spacing, the noise is the first factor over
# h^2.5, and the bias by the sixth derivative is the second factor times h^4.
NOISE_FACTOR = 16.5
BIAS_FACTOR = 1 / 770


@dataclasses.dataclass(frozen=True, eq=False)
class Smoothed:
    """A half-cycle with velocity and acceleration.

    Attributes:
        half_cycle: its samples.
        x, v, a: position [m], velocity [m/s] and acceleration [m/s^2], shape (n,).
        operators: sparse matrices, shape (n, n), that map the samples to x, v and a.
    """

    half_cycle: HalfCycle
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    operators: tuple[Any, Any, Any]

    def std(self, weights: tuple[Any, Any, Any]) -> np.ndarray:
        """Return the standard deviation of weighted sums of x, v and a.

        There is one sum per sample, shape (n,).
        """
        from scipy.sparse import diags_array

        x, v, a = (diags_array(w) @ operator for w, operator in zip(weights, self.operators, strict=True))
        combined = x + v + a
        return self.half_cycle.noise * np.sqrt(np.asarray(combined.multiply(combined).sum(axis=1)).ravel())

    def response(self, weights: tuple[Any, Any, Any]) -> Any:
        """Return the weights of the samples that act like those given.

        The given weights of x, v and a have shape (n, ...), and both weighted sums are equal.
        """
        x, v, a = (operator.T @ w for w, operator in zip(weights, self.operators, strict=True))
        return x + v + a


def smooth(
    half_cycle: HalfCycle, shortest: float | None = None, *, acceleration: float = 0.0, lengthened: float = 1.0
) -> Smoothed:
    """Compute position, velocity and acceleration in one half-cycle.

    Args:
        half_cycle: its evenly spaced samples.
        shortest: length of the shortest window [s]; None: the noise of acceleration is 2 % of `acceleration`.
        acceleration: deceleration by friction alone [m/s^2].
        lengthened: factor on the lengths of all windows.
    """
    size, step = half_cycle.t.size, half_cycle.step
    phase = np.pi * step / (half_cycle.end - half_cycle.begin)
    relative = half_cycle.noise / (np.ptp(half_cycle.x) / 2)
    # Bias is a tenth of the noise at (phase h)^4 / 770 = 0.1 * 16.5 relative / (phase^2 h^2.5).
    wide = (0.1 * NOISE_FACTOR / BIAS_FACTOR * relative / phase**6) ** (1 / 6.5)
    wanted = 0.02 * acceleration * step**2 / half_cycle.noise
    narrow = (NOISE_FACTOR / wanted) ** 0.4 if shortest is None else shortest / step / 2
    largest = (size - 1) // 4
    narrow = int(np.clip(round(lengthened * narrow), SHORTEST, largest))
    wide = int(np.clip(round(lengthened * wide), narrow, largest))
    operators = _operators(size, narrow, wide, lengthened * REACH)
    scaled = tuple(operator / step**k for k, operator in enumerate(operators))
    return Smoothed(half_cycle, *(operator @ half_cycle.x for operator in scaled), scaled)  # type: ignore[arg-type]


# Half-cycles of one record have similar lengths, and each is smoothed twice.
@functools.lru_cache(maxsize=64)
def _operators(n: int, narrow: int, wide: int, reach: float) -> tuple[Any, Any, Any]:
    """Return sparse operators for the value and the first two derivatives.

    Their shape is (n, n), at unit spacing.
    """
    from scipy.signal import savgol_coeffs
    from scipy.sparse import csr_array

    index = np.arange(n)
    distance = np.minimum(index, n - 1 - index)
    steps = 1 + max(1, round(np.log(wide / narrow) / np.log(GROWTH)))
    levels = np.unique(np.append(np.geomspace(narrow, wide, steps).astype(int), narrow))
    half = levels[np.searchsorted(levels, np.clip(reach * distance, narrow, wide), side="right") - 1]
    first = np.clip(index - half, 0, n - 1 - 2 * half)
    columns = np.concatenate([np.arange(a, a + 2 * h + 1) for a, h in zip(first, half, strict=True)])
    starts = np.concatenate([[0], np.cumsum(2 * half + 1)])
    # Coefficients by half-width and position in the window; all samples in the middle of a half-cycle share them.
    windows = list(zip(half.tolist(), (index - first).tolist(), strict=True))
    kernels = {
        (h, place): [savgol_coeffs(2 * h + 1, DEGREE, k, pos=place, use="dot") for k in range(3)]
        for h, place in dict.fromkeys(windows)
    }
    values = (np.concatenate([kernels[where][k] for where in windows]) for k in range(3))
    return tuple(csr_array((v, columns, starts), shape=(n, n)) for v in values)  # type: ignore[return-value]
