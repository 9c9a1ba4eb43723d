"""Do the residuals look like noise? Three tests, each of which sees another kind of failure of a law.

Neighbouring residuals correlate where the computed motion is too slow or too fast for a while (`whiteness`); signs come
in long rows where it lies on one side (Wald and Wolfowitz, Ann. Math. Stat. 11, 1940); and power at the natural
frequency that stands out of its surroundings is a motion of the mass that the model does not have: wrong damping, or a
floor that shakes.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..fitting.noise import Whiteness, whiteness

# Frequencies beside the natural one whose mean power is the background, and the nearest of them in resolutions: the
# one beside it still shares the power of a line that lies between the two.
_NEIGHBOURS, _NEAREST = 24, 2


class Signs(NamedTuple):
    """Test of Wald and Wolfowitz on the signs of the residuals.

    Attributes:
        rows: number of rows of equal signs; `expected`: its mean for independent signs.
        score: distance between the two in standard deviations; far below zero where residuals stay on one side.
    """

    rows: int
    expected: float
    score: float


class Resonance(NamedTuple):
    """Power of the residuals at the natural frequency.

    Attributes:
        ratio: power over its mean at the neighbouring frequencies; one for noise.
        chance: probability of a larger ratio in white Gaussian noise.
    """

    ratio: float
    chance: float


class ResidualTests(NamedTuple):
    """The tests of one fit; those of several runs are taken together."""

    whiteness: Whiteness
    signs: Signs
    resonance: Resonance

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the tests that noise alone would fail less often than once in a thousand times."""
        passed = {
            "white": self.whiteness.white,
            "signs": math.erfc(abs(self.signs.score) / math.sqrt(2)) >= thresholds.RARE,
            "resonance": not self.resonance.chance < thresholds.RARE,
        }
        return tuple(name for name, passes in passed.items() if not passes)

    @property
    def outcome(self) -> str:
        """The same in words."""
        return f"failed: {', '.join(self.failed)}" if self.failed else "passed"


def diagnose(times: Sequence[np.ndarray], residuals: Sequence[np.ndarray], frequency: float) -> ResidualTests:
    """Test the residuals of one or several runs.

    Args:
        times: instants of the fitted samples of each run [s], evenly spaced but for gaps.
        residuals: residuals there in units of the noise.
        frequency: natural frequency [Hz].
    """
    worst = max(map(whiteness, residuals), key=lambda tested: (not tested.white, tested.correlation_time))
    return ResidualTests(worst, signs(residuals), resonance(times, residuals, frequency))


def signs(residuals: Sequence[np.ndarray]) -> Signs:
    """Rows of equal signs; those of several runs add up. Residuals of exactly zero are left out."""
    rows, expected, variance = 0, 0.0, 0.0
    for part in residuals:
        positive = part[part != 0] > 0
        n, up = positive.size, int(positive.sum())
        if n < 2:
            rows, expected = rows + n, expected + n
            continue
        pairs = 2.0 * up * (n - up)
        rows += 1 + int(np.count_nonzero(positive[1:] != positive[:-1]))
        expected += pairs / n + 1
        variance += pairs * (pairs - n) / (n**2 * (n - 1.0))
    score = (rows - expected) / np.sqrt(variance) if variance > 0 else 0.0
    return Signs(rows, expected, float(score))


def resonance(times: Sequence[np.ndarray], residuals: Sequence[np.ndarray], frequency: float) -> Resonance:
    """Power at the natural frequency against that at the nearest frequencies at which white noise is independent.

    In white Gaussian noise the ratio follows Fisher's distribution with 2 and 2 m degrees of freedom per run.
    """
    from scipy.stats import f as fisher

    if not frequency > 0 or any(part.size < 2 * _NEIGHBOURS for part in residuals):
        return Resonance(np.nan, np.nan)
    powers = np.array([_powers(t - t[0], part, frequency) for t, part in zip(times, residuals, strict=True)])
    at, around = powers[:, 0].sum(), powers[:, 1:].mean(axis=1).sum()
    ratio = float(at / around) if around > 0 else 1.0
    runs = powers.shape[0]
    return Resonance(ratio, float(fisher.sf(ratio, 2 * runs, 2 * runs * _NEIGHBOURS)))


def _powers(t: np.ndarray, residual: np.ndarray, frequency: float) -> np.ndarray:
    """Squared Fourier amplitude at a frequency and at its neighbours."""
    span = t[-1] * t.size / (t.size - 1)
    below = np.arange(_NEAREST, max(int(frequency * span), _NEAREST))
    steps = np.concatenate([-below, np.arange(_NEAREST, _NEIGHBOURS + _NEAREST)])
    near = np.sort(steps[np.argsort(np.abs(steps), kind="stable")][:_NEIGHBOURS])
    frequencies = frequency + np.concatenate([[0.0], near / span])
    return np.array([abs(np.exp(-2j * np.pi * f * t) @ residual) ** 2 for f in frequencies])
