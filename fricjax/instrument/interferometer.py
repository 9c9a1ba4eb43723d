"""Imperfections of a displacement interferometer.

The effects act in this order: sampling instant, wavelength, offset and drift of the zero, leakage between the beams,
electronic noise, counter. A non-zero number switches an effect on. Each effect adds one line to the log of the record.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..data.record import Step
from ..errors import UsageError
from ..numbers import number
from .run import not_negative, pair, positive


@dataclasses.dataclass(frozen=True)
class Interferometer:
    """An instrument and its imperfections; 0 switches an effect off.

    Attributes:
        noise: standard deviation of the white noise [m].
        quantisation: displacement of one count [m], for example wavelength/2048.
        offset: reading at the equilibrium of the spring [m].
        drift: slow change of the reading [m/s], counted from the first sample.
        periodic_nonlinearity: amplitudes of first and second order [m]; a single number is the first order.
        wavelength: vacuum wavelength of the laser [m].
        passes: 1 for a single-pass interferometer, 2 for a double-pass one.
        sampling_jitter: standard deviation of the sampling instants [s].
        scale_error: relative error of the wavelength, cosine error included [1].

    Raises:
        UsageError: a value is outside its range; the message names it.

    Examples:
        The standard deviation of a reading, with noise and rounding to whole counts:

        >>> print(f"{Interferometer(noise=3e-10, quantisation=633e-9 / 2048).sigma:.3g} m")
        3.13e-10 m
    """

    noise: float = 1e-9
    quantisation: float = 0.0
    offset: float = 0.0
    drift: float = 0.0
    periodic_nonlinearity: float | tuple[float, float] = 0.0
    wavelength: float = 633e-9
    passes: int = 1
    sampling_jitter: float = 0.0
    scale_error: float = 0.0

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {
            "noise": not_negative("noise", self.noise, "m"),
            "quantisation": not_negative("quantisation", self.quantisation, "m"),
            "offset": number("offset", self.offset, "m"),
            "drift": number("drift", self.drift, "m/s"),
            "periodic_nonlinearity": pair("periodic_nonlinearity", self.periodic_nonlinearity, "m"),
            "wavelength": positive("wavelength", self.wavelength, "m"),
            "sampling_jitter": not_negative("sampling_jitter", self.sampling_jitter, "s"),
            "scale_error": number("scale_error", self.scale_error),
        }
        if self.passes not in (1, 2):
            raise UsageError(f"passes must be 1 (single pass) or 2 (double pass), got {self.passes!r}.")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def sigma(self) -> float:
        """Standard deviation of the reading [m] from noise and rounding."""
        return float(np.hypot(self.noise, self.quantisation / np.sqrt(12.0)))

    def observe(
        self, t: np.ndarray, x: np.ndarray, v: np.ndarray, generators: Mapping[str, np.random.Generator]
    ) -> tuple[np.ndarray, tuple[Step, ...]]:
        """Compute the reading of a motion, with a log step per effect.

        Args:
            t: sampling times [s], shape (samples,).
            x: true displacement [m], shape (samples,).
            v: true velocity [m/s], shape (samples,).
            generators: random number generators `"sampling_jitter"` and `"noise"`.

        Returns:
            The reading [m], shape (samples,), and the log steps.
        """
        steps: list[Step] = []

        def log(name: str, effect: str, *further: str) -> None:
            steps.append(Step(name, {key: getattr(self, key) for key in (name, *further)}, effect))

        if self.sampling_jitter:
            log("sampling_jitter", f"sampling instants scatter by {self.sampling_jitter:g} s")
            # To first order in the delay; the neglected term, a dt^2/2, is about 1e-14 m for 50 ns at 10 m/s^2.
            x = x + v * (self.sampling_jitter * generators["sampling_jitter"].standard_normal(x.shape))
        if self.scale_error:
            log("scale_error", f"displacements times 1 {self.scale_error:+g}")
            x = x * (1.0 + self.scale_error)
        if self.offset:
            log("offset", f"{self.offset:+g} m")
            x = x + self.offset
        if self.drift:
            log("drift", f"{self.drift:+g} m/s from the first sample on")
            x = x + self.drift * (t - t[0])
        first, second = pair("periodic_nonlinearity", self.periodic_nonlinearity, "m")
        if first or second:
            # The error from leakage between the beams has the period of a fringe: half a wavelength in a single-pass
            # interferometer, a quarter in a double-pass one.
            fringe = self.wavelength / (2 * self.passes)
            text = f"{first:g} m of first and {second:g} m of second order over fringes of {fringe:g} m"
            log("periodic_nonlinearity", text, "wavelength", "passes")
            theta = 4 * np.pi * self.passes * x / self.wavelength
            x = x + first * np.sin(theta) + second * np.sin(2 * theta)
        if self.noise:
            log("noise", f"white, standard deviation {self.noise:g} m")
            x = x + self.noise * generators["noise"].standard_normal(x.shape)
        if self.quantisation:
            log("quantisation", f"rounded to whole counts of {self.quantisation:g} m")
            x = np.round(x / self.quantisation) * self.quantisation
        return x, tuple(steps)
