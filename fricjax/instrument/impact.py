"""Simulated impact test.

A hammer strikes the mass once or several times; force and displacement are recorded. The pulse is half a sine,
``F sin(pi t/T)`` for ``0 < t < T``. It is the sum of two sines, one that begins at the start and one that begins at the
end of the pulse. The response of a linear oscillator to each sine has a closed form, so the simulated record has no
integration error.
"""

import dataclasses
import math

import numpy as np

from ..errors import UsageError
from .run import positive


@dataclasses.dataclass(frozen=True, eq=False)
class ImpactTest:
    """Force and displacement of an impact test.

    Attributes:
        t: times since the start of the blow [s], shape (n,).
        force: force of the hammer [N], shape (hits, n).
        displacement: displacement of the mass [m], shape (hits, n).

    Examples:
        >>> ImpactTest(np.arange(3) / 1e3, np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3))).force.shape
        (1, 3)
    """

    t: np.ndarray
    force: np.ndarray
    displacement: np.ndarray


def impact_test(
    mass: float,
    stiffness: float,
    damping: float,
    *,
    duration: float,
    rate: float,
    peak_force: float = 10.0,
    pulse: float = 5e-3,
    noise: float = 0.01,
    hits: int = 1,
    seed: int = 0,
) -> ImpactTest:
    """Simulate an impact test of an oscillator without friction.

    Args:
        mass: moving mass [kg].
        stiffness: stiffness [N/m].
        damping: viscous coefficient [N s/m], below the critical one.
        duration: length of each record [s].
        rate: sampling rate [Hz].
        peak_force: maximum force of the blow [N].
        pulse: duration of the blow [s].
        noise: standard deviation of the white noise of each channel, as a fraction of its largest value.
        hits: number of blows, each with a separate record.
        seed: seed of the random noise.

    Returns:
        The test.

    Raises:
        UsageError: a value is not positive, or the damping is not below the critical one.

    Examples:
        >>> test = impact_test(0.41, 2574.0, 0.18, duration=1.0, rate=2000.0, hits=3)
        >>> test.force.shape, test.displacement.shape
        ((3, 2000), (3, 2000))
    """
    units = {"mass": "kg", "stiffness": "N/m", "duration": "s", "rate": "Hz", "pulse": "s"}
    for name, value in zip(units, (mass, stiffness, duration, rate, pulse), strict=True):
        positive(name, value, units[name])
    if not 0 <= damping < 2 * math.sqrt(stiffness * mass):
        raise UsageError(f"damping must lie between zero and the critical 2 sqrt(k m), got {damping:g} N s/m.")
    t = np.arange(round(duration * rate)) / rate
    start, end = (_ramped_sine(times, math.pi / pulse, mass, stiffness, damping) for times in (t, t - pulse))
    displacement = peak_force * (start + end)
    force = np.where(t < pulse, peak_force * np.sin(math.pi * t / pulse), 0.0)
    generator = np.random.default_rng(seed)
    scatter = lambda channel: noise * np.abs(channel).max() * generator.standard_normal((hits, channel.size))
    return ImpactTest(t, force + scatter(force), displacement + scatter(displacement))


def _ramped_sine(t: np.ndarray, drive: float, mass: float, stiffness: float, damping: float) -> np.ndarray:
    """Displacement [m] from rest under a force ``sin(drive t)`` of 1 N.

    The force begins at t = 0.
    """
    omega = math.sqrt(stiffness / mass)
    decay = damping / (2 * mass)
    ringing = math.sqrt(omega**2 - decay**2)
    steady = 1 / (stiffness - mass * drive**2 + 1j * damping * drive)
    cosine = -steady.imag
    sine = (decay * cosine - drive * steady.real) / ringing
    after = np.maximum(t, 0.0)
    free = np.exp(-decay * after) * (cosine * np.cos(ringing * after) + sine * np.sin(ringing * after))
    return (steady * np.exp(1j * drive * after)).imag + free
