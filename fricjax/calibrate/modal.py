"""The receptance of one mode, ``X/F = 1/(k - m w^2 + i w c) + r``, fitted to all lines of a spectrum at once.

The residual compliance r stands for the modes above the band. The noise of a line has a constant part, from the
displacement, and a part in proportion to the receptance, from the force. Both are estimated from the residuals, and fit
and noise are repeated in turn until they agree.
"""

from typing import NamedTuple

import numpy as np

from ..errors import DataError
from ..rig.measured import Measured
from .peaks import Mode

# Rounds of fit and noise in turn, each with the weights of the one before.
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
# Least variance of a line over the square of its receptance: rounding, where a receptance has no noise at all.
_FLOOR = 1e-24


class FittedMode(NamedTuple):
    """A fitted mode.

    Attributes:
        logarithms: of natural frequency [Hz], damping ratio [1] and static compliance 1/k [m/N], and then, not as a
            logarithm, the residual compliance over the static one; shape (4,).
        covariance: of these, shape (4, 4).
        constant, relative: standard deviation of the noise of one line, the constant part [m/N] and that in proportion
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
        """The mode by the numbers that peak picking gives as well."""
        natural, ratio, compliance = np.exp(self.logarithms[:3])
        return Mode(float(natural), float(ratio), float(1 / compliance))

    @property
    def line_noise(self) -> np.ndarray:
        """Standard deviation of each complex line [m/N], shape (n,)."""
        return np.hypot(self.constant, self.relative * np.abs(self.fitted))

    def measured(self, name: str, scale_std: float) -> Measured:
        """One of `NAMES` with its standard uncertainty; a product of powers has the relative one of a sum.

        Args:
            name: which.
            scale_std: relative standard uncertainty of the receptance's scale.
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
    """Receptance [m/N] at frequencies [Hz], shape (n,), for the numbers of `FittedMode.logarithms`."""
    natural, ratio, compliance = np.exp(logarithms[:3])
    r = frequency / natural
    return compliance * (1 / (1 - r**2 + 2j * ratio * r) + logarithms[3])


def fit_mode(frequency: np.ndarray, receptance: np.ndarray, start: Mode) -> FittedMode:
    """Least squares on real and imaginary parts.

    Args:
        frequency: lines of the spectrum [Hz], shape (n,).
        receptance: complex X/F [m/N], shape (n,).
        start: start values.

    Raises:
        DataError: no mode describes the receptance.
    """
    from scipy.optimize import least_squares

    def residual(at: np.ndarray, variance: np.ndarray) -> np.ndarray:
        # Half of the variance of a complex line belongs to its real part, half to its imaginary one.
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
    """Constant and proportional part of the variance, ``E power = constant + relative size``, of greatest likelihood.

    The power of a complex residual is exponentially distributed, so that its standard deviation is its mean: weighted
    least squares, with weights from the round before (Fisher scoring).
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
