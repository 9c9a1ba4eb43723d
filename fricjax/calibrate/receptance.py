"""The receptance of an impact test: what the mass does for a force, line by line, and how sure that is."""

import math

import numpy as np

from ..errors import DataError
from ..instrument.impact import ImpactTest

# Half a sine exceeds half of its height during two thirds of its length, far above the noise of the sensor.
_STRONG = 0.5


def receptance(test: ImpactTest, band: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The receptance X/F by Fourier transform, averaged over the blows for least error from noise of displacement.

    ``H1 = sum conj(F) X / sum |F|^2`` (Bendat and Piersol, Random Data). Before, the force is set to zero outside of
    the blow, where it is nothing but noise.

    Args:
        test: the records; each must begin with the mass at rest and last until the motion has died out.
        band: lowest and highest frequency to return [Hz].

    Returns:
        Frequencies [Hz], shape (m,), and the complex receptance [m/N], shape (m,).

    Raises:
        DataError: a band that holds no line of the spectrum.
    """
    step = float(test.t[1] - test.t[0])
    force = np.fft.rfft(np.where(_blow(test.force), test.force, 0.0))
    motion = np.fft.rfft(test.displacement)
    frequency = np.fft.rfftfreq(test.t.size, step)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    if not inside.any():
        raise DataError(f"No line of the spectrum lies between {band[0]:g} and {band[1]:g} Hz; widen the band.")
    force, motion = force[:, inside], motion[:, inside]
    return frequency[inside], np.sum(force.conj() * motion, axis=0) / np.sum(np.abs(force) ** 2, axis=0)


def force_noise(test: ImpactTest) -> float:
    """Relative standard uncertainty that noise of the force gives the receptance's scale, alike at all lines.

    Below the corner of the pulse's spectrum every line of the force is about the momentum of the blow. Its noise is
    read from the force outside of the blow. For `scale_std` of the calibration, with that of the sensor itself.

    Args:
        test: the records.
    """
    inside = _blow(test.force)
    noise = float(np.std(test.force[:, ~inside]))
    momentum = np.abs(test.force[:, inside].sum(axis=1))
    return noise * math.sqrt(np.count_nonzero(inside) / np.sum(momentum**2))


def _blow(force: np.ndarray) -> np.ndarray:
    """Samples of the blow: those between the first and the last strong force, and a third of them at either end."""
    strong = np.flatnonzero(np.abs(force).max(axis=0) > _STRONG * np.abs(force).max())
    margin = (strong[-1] - strong[0]) // 3 + 1
    samples = np.arange(force.shape[1])
    return (samples >= strong[0] - margin) & (samples <= strong[-1] + margin)
