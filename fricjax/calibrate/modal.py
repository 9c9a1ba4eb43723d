"""Fit of one mode to all lines of a receptance.

The model is ``X/F = 1/(k - m w^2 + i w c) + r``, where the residual compliance r represents the modes above the band.
The noise of a line has a constant part, from the displacement, and a part proportional to the receptance, from the
force. Fit and noise estimate are repeated in turn until they agree.
"""

from typing import NamedTuple

import numpy as np

from ..errors import DataError
from ..rig.measured import Measured
from .peaks import Mode

# Iterations of fit and noise estimate, each with the weights of the previous one.
_ROUNDS = 10
_PARAMETERS = 4
# Powers of natural frequency, damping ratio and static compliance in each quantity, as in c = 2 zeta k/w.
_POWERS = {
    "mass": (-2, 0, -1),
    "stiffness": (0, 0, -1),
    "damping": (-1, 1, -1),
    "frequency": (1, 0, 0),
    "damping_ratio": (0, 1, 0),
}
# Smallest relative variance of a line, from rounding, for a receptance without noise.
_FLOOR = 1e-24


class FittedMode(NamedTuple):
    """A fitted mode.

    Attributes:
        logarithms: logarithms of natural frequency [Hz], damping ratio [1] and static compliance 1/k [m/N], and then
            the ratio of residual to static compliance (not a logarithm); shape (4,).
        covariance: covariance of these four, shape (4, 4).
        constant, relative: standard deviation of the noise of a line, the constant part [m/N] and the part proportional
            to the receptance [1].
        fitted: receptance of the mode at the lines [m/N], shape (n,).
    """

    logarithms: np.ndarray
    covariance: np.ndarray
    constant: float
    relative: float
    fitted: np.ndarray

    @property
    def numbers(self) -> Mode:
        """The mode in the quantities of peak picking."""
        natural, ratio, compliance = np.exp(self.logarithms[:3])
        return Mode(float(natural), float(ratio), float(1 / compliance))

    @property
    def line_noise(self) -> np.ndarray:
        """Standard deviation of each complex line [m/N], shape (n,)."""
        return np.hypot(self.constant, self.relative * np.abs(self.fitted))

    def measured(self, name: str, scale_std: float) -> Measured:
        """Return one of `NAMES` with its standard uncertainty.

        Each quantity is a product of powers of the parameters, so its relative variance is that of a sum of logarithms.

        Args:
            name: the name.
            scale_std: relative standard uncertainty of the scale of the receptance.
        """
        weights = np.array([*_POWERS[name], 0])
        relative = np.hypot(np.sqrt(weights @ self.covariance @ weights), weights[2] * scale_std)
        value = getattr(self.numbers, name)
        return Measured(value, value * relative)

    @property
    def residual_compliance(self) -> Measured:
        """Compliance of the modes above the band [m/N]."""
        compliance = 1 / self.numbers.stiffness
        return Measured(compliance * self.logarithms[3], compliance * np.sqrt(self.covariance[3, 3]))


def mode_receptance(frequency: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
    """Compute the receptance of a mode [m/N].

    Args:
        frequency: frequencies [Hz], shape (n,).
        logarithms: the parameters, see `FittedMode.logarithms`.
    """
    natural, ratio, compliance = np.exp(logarithms[:3])
    r = frequency / natural
    return compliance * (1 / (1 - r**2 + 2j * ratio * r) + logarithms[3])


def fit_mode(frequency: np.ndarray, receptance: np.ndarray, start: Mode) -> FittedMode:
    """Fit a mode by least squares on real and imaginary parts.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,).
        receptance: complex X/F [m/N], shape (n,).
        start: start values.

    Raises:
        DataError: the fit fails.
    """
    from scipy.optimize import least_squares

    def residual(at: np.ndarray, variance: np.ndarray) -> np.ndarray:
        # Half of the variance of a complex line belongs to its real part, half to its imaginary part.
        weighted = (mode_receptance(frequency, at) - receptance) * np.sqrt(2 / variance)
        return np.concatenate([np.real(weighted), np.imag(weighted)])

    at = np.array([*np.log([start.frequency, start.damping_ratio, 1 / start.stiffness]), 0.0])
    variance = np.abs(receptance) ** 2
    for _ in range(_ROUNDS):
        solution = least_squares(residual, at, "3-point", args=(variance,))
        at = solution.x
        if not (solution.success and np.all(np.isfinite(at))):
            raise DataError(f"No mode describes the receptance: {solution.message} Take a band with one resonance.")
        fitted = mode_receptance(frequency, at)
        constant, relative = _noise(np.abs(receptance - fitted) ** 2, np.abs(fitted) ** 2)
        variance = constant + relative * np.abs(fitted) ** 2
    covariance = np.linalg.pinv(solution.jac.T @ solution.jac, hermitian=True)
    return FittedMode(at, covariance, float(np.sqrt(constant)), float(np.sqrt(relative)), fitted)


def _noise(power: np.ndarray, size: np.ndarray) -> tuple[float, float]:
    """Estimate the constant and the proportional part of the variance.

    The model is ``E power = constant + relative size``. The power of a complex residual is exponentially distributed,
    so its standard deviation equals its mean. The maximum likelihood follows from weighted least squares with the
    weights of the previous iteration (Fisher scoring).
    """
    from scipy.optimize import nnls

    parts = np.stack([np.full(size.size, size.mean()), size], axis=1)
    freedom = 2 * size.size / (2 * size.size - _PARAMETERS)
    expected = np.full(size.size, power.mean())
    share = np.zeros(2)
    for _ in range(_ROUNDS):
        expected = np.maximum(expected, _FLOOR * size)
        share = nnls(parts / expected[:, None], power / expected)[0]
        expected = parts @ share
    constant, relative = freedom * share * (size.mean(), 1.0)
    return constant, max(relative, _FLOOR)
