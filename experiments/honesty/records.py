"""Records as instruments write them: motions of two rigs with disturbances.

Release, offset and phase of the clock are random in each record. The kinds in `TUNED` served to choose thresholds. The
kinds in `ASIDE` did not.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

import fricjax as fj
from fricjax.instrument import white_acceleration

STIFFNESS, FREQUENCY, DAMPING_RATIO = 2574.0, 12.6, 0.0027
MASS = STIFFNESS / (2 * math.pi * FREQUENCY) ** 2
DAMPING = 2 * DAMPING_RATIO * math.sqrt(STIFFNESS * MASS)
FLOOR = 3.4e-11  # (m/s^2)^2/Hz, 40 dB below a floor of class VC-C
SHAKEN, RECORDED = "floor motion", "floor motion, recorded"
FULL_SCALE = 10e-3  # full scale of the converters [m]

Noise = Callable[["Rig", np.ndarray, np.ndarray, np.random.Generator], np.ndarray]
Whitened = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Rig(NamedTuple):
    """A machine with its law, its free parameters and its sampling.

    The last part of a run is rest.
    """

    name: str
    oscillator: fj.Oscillator
    free: tuple[str, ...]
    rate: float
    duration: float

    @property
    def t(self) -> np.ndarray:
        return np.arange(round(self.rate * self.duration)) / self.rate


class Run(NamedTuple):
    """A record with its true values.

    Attributes:
        t, x: times [s] and displacements [m].
        half_cycles: true number of half-cycles from the first reversal to the stop.
        floor: acceleration of a shaken floor at the samples [m/s^2], or None.
    """

    t: np.ndarray
    x: np.ndarray
    half_cycles: int
    floor: np.ndarray | None = None


def _machine(load: float, law: fj.friction.AbstractFriction) -> fj.Oscillator:
    return fj.Oscillator(MASS, STIFFNESS, DAMPING, load, law)


RIGS = {
    "sliding": Rig(
        "sliding", _machine(9.66, fj.friction.Stribeck(0.05, mu_s=0.065, v_stribeck=5e-3)),
        ("mu", "damping", "stiffness"), 20e3, 0.65,
    ),
    "rolling": Rig("rolling", _machine(1.89, fj.friction.Coulomb(0.01)), ("mu", "damping", "stiffness"), 5e3, 4.8),
}  # fmt: skip


def white(size: float) -> Noise:
    return lambda rig, t, x, random: x + size * random.standard_normal(t.size)


def share(part: float) -> Noise:
    """White noise of a fraction of the amplitude."""
    return lambda rig, t, x, random: x + part * np.ptp(x) / 2 * random.standard_normal(t.size)


def autoregressive(rho: float, size: float) -> Noise:
    def add(rig: Rig, t: np.ndarray, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
        drive = math.sqrt(1 - rho**2) * size * random.standard_normal(t.size)
        drive[0] /= math.sqrt(1 - rho**2)
        return x + lfilter([1.0], [1.0, -rho], drive)

    return add


def random_walk(step: float) -> Noise:
    return lambda rig, t, x, random: x + np.cumsum(step * random.standard_normal(t.size))


def hum(frequency: float, size: float) -> Noise:
    """A sine of random phase over 1 nm of white noise."""
    return lambda rig, t, x, random: (
        x + (size * np.sin(2 * np.pi * (frequency * t + random.uniform())) + 1e-9 * random.standard_normal(t.size))
    )


def narrow(frequency: float, size: float, lasts: float = 0.08) -> Noise:
    """Narrow-band noise over 1 nm of white noise.

    A resonance with a decay time of `lasts` [s] filters white noise.
    """

    def add(rig: Rig, t: np.ndarray, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
        step = t[1] - t[0]
        pole = np.exp((-1 / lasts + 2j * np.pi * frequency) * step)
        before = round(10 * lasts / step)
        noise = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], random.standard_normal(t.size + before))[before:]
        return x + size / np.std(noise) * noise + 1e-9 * random.standard_normal(t.size)

    return add


def mode(size: float) -> Noise:
    """A decaying structural mode over 1 nm of white noise.

    The release excites it at 60 to 300 Hz, with a damping ratio of one percent.
    """

    def add(rig: Rig, t: np.ndarray, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
        omega = 2 * np.pi * random.uniform(60, 300)
        rings = size * np.exp(-0.01 * omega * t) * np.sin(omega * t + random.uniform(0, 2 * np.pi))
        return x + rings + 1e-9 * random.standard_normal(t.size)

    return add


def drift(speed: float) -> Noise:
    """A drift over 20 nm of white noise."""
    return lambda rig, t, x, random: x + (random.choice([-1, 1]) * speed * t + 20e-9 * random.standard_normal(t.size))


def bits(number: int, size: float) -> Noise:
    """Rounding to the steps of a converter, after white noise."""
    step = FULL_SCALE / 2**number
    return lambda rig, t, x, random: step * np.round((x + size * random.standard_normal(t.size)) / step)


def in_steps(step: float, speed: float, noise: Noise) -> Noise:
    """Rounding to steps, after a drift and a noise."""

    def add(rig: Rig, t: np.ndarray, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return step * np.round((noise(rig, t, x, random) + random.choice([-1, 1]) * speed * t) / step)

    return add


def jitter(size: float) -> Noise:
    """Sampling at inexact times, over 1 nm of white noise."""
    return lambda rig, t, x, random: (
        x + np.gradient(x, t) * size * random.standard_normal(t.size) + 1e-9 * random.standard_normal(t.size)
    )


def outliers(part: float, size: float) -> Noise:
    """Some samples with large errors, over 5 nm of white noise."""
    return lambda rig, t, x, random: (
        x
        + 5e-9 * random.standard_normal(t.size)
        + size * random.standard_normal(t.size) * (random.uniform(size=t.size) < part)
    )


TUNED: dict[str, Noise] = {
    "white 1 nm": white(1e-9),
    "white 5 %": share(0.05),
    "AR(1) 0.9, 20 nm": autoregressive(0.9, 20e-9),
    "AR(1) 0.99, 20 nm": autoregressive(0.99, 20e-9),
    "10 bit": bits(10, 0.0),
    "hum 50 Hz, 10 nm": hum(50.0, 10e-9),
    "narrow 12.6 Hz, 100 nm": narrow(FREQUENCY, 100e-9),
    "drift 1 um/s": drift(1e-6),
    "1 % outliers": outliers(0.01, 1e-5),
    "AR(1) 0.95 drifting, 10 nm steps": in_steps(10e-9, 2e-6, autoregressive(0.95, 20e-9)),
    "white 1 nm drifting, 2 nm steps": in_steps(2e-9, 2e-6, white(1e-9)),
}
ASIDE: dict[str, Noise] = {
    "white 20 nm": white(20e-9),
    "white 1 %": share(0.01),
    "AR(1) 0.5, 100 nm": autoregressive(0.5, 100e-9),
    "AR(1) 0.99, 100 nm": autoregressive(0.99, 100e-9),
    "random walk 5 nm": random_walk(5e-9),
    "16 bit": bits(16, 2e-9),
    "hum 50 Hz, 1 um": hum(50.0, 1e-6),
    "narrow 33 Hz, 100 nm": narrow(33.0, 100e-9),
    "decaying mode 20 nm": mode(20e-9),
    "drift 10 um/s": drift(10e-6),
    "jitter 2 us": jitter(2e-6),
    "AR(1) 0.8 drifting, 30 nm steps": in_steps(30e-9, 5e-6, autoregressive(0.8, 10e-9)),
    "AR(1) 0.99 drifting, 5 nm steps": in_steps(5e-9, 0.5e-6, autoregressive(0.99, 100e-9)),
    SHAKEN: white(1e-9),
    RECORDED: white(1e-9),
}


def independent(size: float) -> Whitened:
    return lambda t, x, columns: columns / size


def remembered(rho: float, size: float) -> Whitened:
    """Innovations of an autoregressive process.

    `size` is its standard deviation, or for `rho` of one the standard deviation of a step.
    """

    def whitened(t: np.ndarray, x: np.ndarray, columns: np.ndarray) -> np.ndarray:
        innovations = columns - rho * np.concatenate([np.zeros((1, columns.shape[1])), columns[:-1]])
        step = size * (math.sqrt(1 - rho**2) if rho < 1 else 1.0)
        innovations[0] *= step / size
        return innovations / step

    return whitened


def beside_a_drift(size: float) -> Whitened:
    def whitened(t: np.ndarray, x: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return (columns - np.outer(t, t @ columns) / (t @ t)) / size

    return whitened


def clocked(size: float) -> Whitened:
    return lambda t, x, columns: columns / np.hypot(1e-9, size * np.gradient(x, t))[:, None]


# Whitening of the derivatives of a record to independent samples of unit variance. Their information matrix is then the
# inverse of the Cramer-Rao bound. Some kinds are missing: a share of the amplitude differs in size from run to run, and
# rounding has no known noise law. With outliers the robust loss is a twentieth less efficient.
KNOWN: dict[str, Whitened] = {
    "white 1 nm": independent(1e-9),
    "white 20 nm": independent(20e-9),
    "AR(1) 0.9, 20 nm": remembered(0.9, 20e-9),
    "AR(1) 0.99, 20 nm": remembered(0.99, 20e-9),
    "AR(1) 0.5, 100 nm": remembered(0.5, 100e-9),
    "AR(1) 0.99, 100 nm": remembered(0.99, 100e-9),
    "random walk 5 nm": remembered(1.0, 5e-9),
    "hum 50 Hz, 10 nm": independent(1e-9),
    "hum 50 Hz, 1 um": independent(1e-9),
    "drift 1 um/s": beside_a_drift(20e-9),
    "drift 10 um/s": beside_a_drift(20e-9),
    "jitter 2 us": clocked(2e-6),
    "1 % outliers": independent(5e-9),
}


# Instrument errors that a record does not reveal, as standard uncertainties. The phase of the nonlinearity of 5 nm is
# unknown. The other errors are those of a poor encoder and exceed the noise by far.
INPUTS: dict[str, dict[str, fj.Measured]] = {
    "nonlinearity 5 nm": {"periodic_nonlinearity": fj.Measured(0.0, 5e-9 / math.sqrt(2))},
    "displacement scale 1e-4": {"displacement_scale": fj.Measured(1.0, 1e-4)},
    "time scale 1e-4": {"time_scale": fj.Measured(1.0, 1e-4)},
}
FRINGE = 316.5e-9  # m


def read_with(rig: Rig, kind: str, seed: int) -> Run:
    """Simulate a run with a random instrument error.

    The noise is white, of 1 nm. The error follows the standard uncertainty of the instrument.
    """
    random, inputs = np.random.default_rng([3, seed]), INPUTS[kind]
    errors = {name: given.std * random.standard_normal() for name, given in inputs.items()}
    clock = 1 + errors.get("time_scale", 0.0)
    run = motion(rig._replace(rate=rig.rate / clock, duration=rig.duration * clock), np.random.default_rng([1, seed]))
    x = run.x / (1 + errors.get("displacement_scale", 0.0))
    if "periodic_nonlinearity" in inputs:
        amplitude = math.sqrt(2) * inputs["periodic_nonlinearity"].std
        x = x + amplitude * np.sin(2 * np.pi * (x / FRINGE + random.uniform()))
    return run._replace(t=rig.t, x=white(1e-9)(rig, rig.t, x, np.random.default_rng([2, seed])))


def motion(rig: Rig, random: np.random.Generator, floor: float = 0.0) -> Run:
    """Simulate a run without noise.

    It is released from 1 to 2.6 mm on either side, about a random equilibrium, at a random instant. `floor` is the
    power spectral density of a white floor acceleration [(m/s^2)^2/Hz].
    """
    # From 1 mm, two half-cycles follow the first reversal. Fewer would not separate friction from the offset.
    x0 = random.choice([-1, 1]) * random.uniform(1.0e-3, 2.6e-3)
    t, offset = rig.t + random.uniform() / rig.rate, random.uniform(-1e-3, 1e-3)
    if not floor:
        slide = fj.simulate(rig.oscillator, x0, t)
        return Run(rig.t, np.asarray(slide.x) + offset, int(slide.n_half_cycles) - 1)
    acceleration = white_acceleration(t.size, rig.rate, floor, random)
    shaken = fj.simulate(rig.oscillator, x0, t, base_acceleration=acceleration)
    v = np.asarray(shaken.v)
    directions = np.sign(v[~np.asarray(shaken.at_rest) & (v != 0)])
    return Run(rig.t, np.asarray(shaken.x) + offset, int(np.count_nonzero(np.diff(directions))), acceleration)


def record(rig: Rig, kind: str, seed: int) -> Run:
    """Simulate a run with noise.

    The same seed gives the same motion under every noise.
    """
    clean = motion(rig, np.random.default_rng([1, seed]), FLOOR if kind in (SHAKEN, RECORDED) else 0.0)
    noise = {**TUNED, **ASIDE}[kind]
    return clean._replace(x=noise(rig, clean.t, clean.x, np.random.default_rng([2, seed])))
