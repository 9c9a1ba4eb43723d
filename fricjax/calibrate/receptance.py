"""Receptance of an impact test, and its uncertainty from force noise."""

import math

import numpy as np

from ..errors import DataError
from ..instrument.impact import ImpactTest

# Half a sine exceeds half of its height during two thirds of its duration, far above the noise of the sensor.
_STRONG = 0.5


def receptance(test: ImpactTest, band: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Compute the receptance X/F of an impact test by Fourier transform.

    The average over the blows, ``H1 = sum conj(F) X / sum |F|^2``, has the smallest error from noise of the
    displacement (Bendat and Piersol, Random Data). The force is first set to zero outside the blow, where it is pure
    noise.

    Args:
        test: the records; each must begin with the mass at rest and last until the motion has decayed.
        band: lowest and highest frequency to return [Hz].

    Returns:
        Frequencies [Hz], shape (m,), and the complex receptance [m/N], shape (m,).

    Raises:
        DataError: the band contains no line of the spectrum.
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
    """Compute the relative standard uncertainty of the scale from force noise.

    The uncertainty is the same at all lines, because below the corner frequency of the pulse every line of the force is
    about the momentum of the blow. The noise is taken from the force outside the blow. Combine the result with the
    uncertainty of the force sensor for `scale_std` of the calibration.

    Args:
        test: the records.
    """
    inside = _blow(test.force)
    noise = float(np.std(test.force[:, ~inside]))
    momentum = np.abs(test.force[:, inside].sum(axis=1))
    return noise * math.sqrt(np.count_nonzero(inside) / np.sum(momentum**2))


def _blow(force: np.ndarray) -> np.ndarray:
    """Mask of the samples of the blow.

    They lie between the first and the last strong force, with a margin of a third of this duration on each side.
    """
    strong = np.flatnonzero(np.abs(force).max(axis=0) > _STRONG * np.abs(force).max())
    margin = (strong[-1] - strong[0]) // 3 + 1
    samples = np.arange(force.shape[1])
    return (samples >= strong[0] - margin) & (samples <= strong[-1] + margin)
