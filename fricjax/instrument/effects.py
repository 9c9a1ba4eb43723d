"""What stands between the true motion and the displayed displacement: one small function per effect.

Each takes displacements [m] and returns displacements [m]; none changes its argument.
"""

import numpy as np

Samples = np.ndarray


def jitter(x: Samples, v: Samples, std: float, generator: np.random.Generator) -> Samples:
    """Samples taken a little early or late: ``x + v dt`` with ``dt`` normal, standard deviation `std` [s].

    To first order in ``dt``; what is neglected, ``a dt^2/2``, is below 1e-14 m for 50 ns at 10 m/s^2.
    """
    return x + v * (std * generator.standard_normal(x.shape))


def scale(x: Samples, error: float) -> Samples:
    """A wavelength, or a cosine, that is wrong by the relative `error` [1]."""
    return x * (1.0 + error)


def shift(x: Samples, offset: float) -> Samples:
    """A counter whose zero is not the equilibrium of the spring: `offset` [m]."""
    return x + offset


def drift(t: Samples, x: Samples, rate: float) -> Samples:
    """A slow change of the optical path, `rate` [m/s] times the time since the first sample."""
    return x + rate * (t - t[0])


def periodic_nonlinearity(x: Samples, first: float, second: float, wavelength: float, passes: int) -> Samples:
    """Leakage between the beams: errors of first and second order in the optical phase.

    ``x + A1 sin(theta) + A2 sin(2 theta)``, where ``theta = 4 pi passes x/wavelength``: one fringe per half
    wavelength in a single-pass interferometer, per quarter in a double-pass one.
    """
    theta = 4 * np.pi * passes * x / wavelength
    return x + first * np.sin(theta) + second * np.sin(2 * theta)


def white_noise(x: Samples, std: float, generator: np.random.Generator) -> Samples:
    """Normal noise of standard deviation `std` [m], independent from sample to sample."""
    return x + std * generator.standard_normal(x.shape)


def quantise(x: Samples, step: float) -> Samples:
    """Rounding to whole counts of `step` [m]."""
    return np.round(x / step) * step
