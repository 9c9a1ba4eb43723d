"""Peak picking: modal parameters from three points of a receptance.

Near a lightly damped resonance the imaginary part has a minimum at the natural frequency, ``Im = -1/(2 zeta k)``. The
real part has its extrema half a bandwidth below and above, at ``f_n (1 -+ zeta)`` (Schmitz and Smith, Machining
Dynamics). The lines of a spectrum do not coincide with these points, so each point is located with a polynomial through
the lines around it.
"""

from typing import NamedTuple

import numpy as np

from ..errors import DataError

NAMES = ("mass", "stiffness", "damping", "frequency", "damping_ratio")
SCALED = ("mass", "stiffness", "damping")  # inversely proportional to the scale of the receptance
# The polynomial uses the lines above this fraction of the extremum, and its maximum is searched at this many points.
_AROUND = 0.7
_FINE = 2001
# Number of simulations; they determine the error of the picking to 1/sqrt(2*50), 10 %.
_REPEATS = 50


class Mode(NamedTuple):
    """Natural frequency [Hz], damping ratio [1] and stiffness [N/m] of a mode."""

    frequency: float
    damping_ratio: float
    stiffness: float

    @property
    def mass(self) -> float:
        """Moving mass k/w^2 [kg]."""
        return self.stiffness / (2 * np.pi * self.frequency) ** 2

    @property
    def damping(self) -> float:
        """Viscous coefficient 2 zeta k/w [N s/m]."""
        return self.damping_ratio * self.stiffness / (np.pi * self.frequency)

    def numbers(self) -> np.ndarray:
        """All quantities in the order of `NAMES`, shape (5,)."""
        return np.array([getattr(self, name) for name in NAMES])


def pick(frequency: np.ndarray, receptance: np.ndarray) -> Mode:
    """Pick the peaks of one resonance.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,), increasing.
        receptance: complex X/F [m/N], shape (n,).

    Raises:
        DataError: there is no resonance within the band, or the receptance has the wrong sign.
    """
    real, imaginary = np.real(receptance), np.imag(receptance)
    lowest = int(np.argmin(imaginary))
    if not 1 < lowest < frequency.size - 2:
        raise DataError(
            f"The imaginary part of the receptance has its minimum at {frequency[lowest]:.6g} Hz, the edge of the band."
            " Take a band with the resonance well inside, and X/F with the sign that makes it negative there."
        )
    natural, depth = _top(frequency, -imaginary, lowest)
    rise = int(np.argmax(real[: lowest + 1]))
    fall = lowest + int(np.argmin(real[lowest:]))
    below, _ = _top(frequency, real, rise)
    above, _ = _top(frequency, -real, fall)
    if not (depth > 0 and above > below):
        raise DataError("The receptance shows no resonance: its real part does not fall through zero. Check X/F.")
    ratio = (above - below) / (2 * natural)
    return Mode(natural, ratio, 1 / (2 * ratio * depth))


def _top(frequency: np.ndarray, values: np.ndarray, peak: int) -> tuple[float, float]:
    """Position and height of a maximum near line `peak`, from a polynomial."""
    low = np.flatnonzero(values < _AROUND * values[peak])
    first = int(low[low < peak].max(initial=-1)) + 1
    last = int(low[low > peak].min(initial=values.size)) - 1
    # At least one line on each side, within the band.
    first, last = max(min(first, peak - 1), 0), min(max(last, peak + 1), values.size - 1)
    f, y = frequency[first : last + 1] - frequency[peak], values[first : last + 1]
    polynomial = np.polynomial.Polynomial.fit(f, y, min(4, f.size - 1))
    fine = np.linspace(f[0], f[-1], _FINE)
    heights = polynomial(fine)
    best = int(np.argmax(heights))
    return float(frequency[peak] + fine[best]), float(heights[best])


def picking_error(frequency: np.ndarray, receptance: np.ndarray, noise: np.ndarray, truth: Mode) -> np.ndarray:
    """Simulate the root mean square error of peak picking.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,).
        receptance: receptance without noise [m/N], shape (n,).
        noise: standard deviation of each complex line [m/N], shape (n,).
        truth: the mode of this receptance.

    Returns:
        The errors in the order of `NAMES`, shape (5,).
    """
    generator = np.random.default_rng(0)
    drawn = generator.standard_normal((_REPEATS, 2, frequency.size)) * noise / np.sqrt(2)
    picked = np.stack([pick(frequency, receptance + draw[0] + 1j * draw[1]).numbers() for draw in drawn])
    return np.sqrt(np.mean((picked - truth.numbers()) ** 2, axis=0))
