"""An impact test: a hammer strikes the mass once or several times, and force and displacement are recorded.

The pulse is half a sine, ``F sin(pi t/T)`` for ``0 < t < T``: the sum of two sines, one from the start on and one from
the end of the pulse on. The response of a linear oscillator to each is known in closed form, so that the simulated
record has no error of integration.
"""

import dataclasses
import math

import numpy as np

from ..errors import DataError, UsageError
from ..rig.measured import positive

# Half a sine exceeds half of its height during two thirds of its length, far above the noise of the sensor.
_STRONG = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class ImpactTest:
    """Force and displacement of a test.

    Attributes:
        t: times from the start of the blow [s], shape (n,).
        force: force of the hammer [N], shape (hits, n).
        displacement: displacement of the mass [m], shape (hits, n).
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
        peak_force: highest force of the blow [N].
        pulse: duration of the blow [s].
        noise: standard deviation of the white noise of either channel, as a fraction of its largest value.
        hits: number of blows, each recorded by itself.
        seed: number from which the noise follows.

    Returns:
        The test.

    Raises:
        UsageError: a value that is not positive, or a damping that lets nothing swing.
    """
    units = {"mass": "kg", "stiffness": "N/m", "duration": "s", "rate": "Hz", "pulse": "s"}
    for name, value in zip(units, (mass, stiffness, duration, rate, pulse), strict=True):
        positive(name, units[name], value)
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
    """Displacement [m] under a force ``sin(drive t)`` of 1 N that begins at t = 0, from rest; zero before."""
    omega = math.sqrt(stiffness / mass)
    decay = damping / (2 * mass)
    ringing = math.sqrt(omega**2 - decay**2)
    steady = 1 / (stiffness - mass * drive**2 + 1j * damping * drive)
    cosine = -steady.imag
    sine = (decay * cosine - drive * steady.real) / ringing
    after = np.maximum(t, 0.0)
    free = np.exp(-decay * after) * (cosine * np.cos(ringing * after) + sine * np.sin(ringing * after))
    return (steady * np.exp(1j * drive * after)).imag + free


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
