"""Three tests that the residuals are noise.

Each test detects a different failure of a law. Neighbouring residuals correlate if the computed motion is too slow or
too fast for some time (`whiteness`). Signs form long rows if the computed motion stays on one side (Wald and Wolfowitz,
Ann. Math. Stat. 11, 1940). Excess power at the natural frequency is a motion of the mass that the model does not
include: wrong damping, or a vibrating floor.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..fitting.noise import Whiteness, whiteness

# Number of neighbouring frequencies that determine the background, and distance of the nearest one in units of the
# resolution. The frequency at distance one is excluded, because it shares the power of a line in between.
_NEIGHBOURS, _NEAREST = 24, 2


class Signs(NamedTuple):
    """Test of Wald and Wolfowitz on the signs of the residuals.

    Attributes:
        rows: number of rows of equal signs.
        expected: mean number for independent signs.
        score: difference in standard deviations; far below zero if residuals stay on one side.
    """

    rows: int
    expected: float
    score: float


class Resonance(NamedTuple):
    """Power of the residuals at the natural frequency.

    Attributes:
        ratio: power over mean power at the neighbouring frequencies; one for noise.
        chance: probability of a larger ratio in white Gaussian noise.
    """

    ratio: float
    chance: float


class ResidualTests(NamedTuple):
    """The tests of one fit, over all its runs."""

    whiteness: Whiteness
    signs: Signs
    resonance: Resonance

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the failed tests, each with a false-alarm rate of 1/1000."""
        passed = {
            "white": self.whiteness.white,
            "signs": math.erfc(abs(self.signs.score) / math.sqrt(2)) >= thresholds.RARE,
            "resonance": not self.resonance.chance < thresholds.RARE,
        }
        return tuple(name for name, passes in passed.items() if not passes)

    @property
    def outcome(self) -> str:
        """Outcome of the tests in words."""
        return f"failed: {', '.join(self.failed)}" if self.failed else "passed"


def diagnose(times: Sequence[np.ndarray], residuals: Sequence[np.ndarray], frequency: float) -> ResidualTests:
    """Test the residuals of one or several runs.

    Args:
        times: times of the fitted samples of each run [s], evenly spaced except for gaps.
        residuals: residuals at these times in units of the noise.
        frequency: natural frequency [Hz].
    """
    worst = max(map(whiteness, residuals), key=lambda tested: (not tested.white, tested.correlation_time))
    return ResidualTests(worst, signs(residuals), resonance(times, residuals, frequency))


def signs(residuals: Sequence[np.ndarray]) -> Signs:
    """Count rows of equal signs over all runs.

    Residuals of exactly zero are left out.
    """
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
    """Compare the power at the natural frequency with that at its neighbours.

    At the neighbouring frequencies white noise is independent. For white Gaussian noise the ratio follows Fisher's
    distribution with 2 and 2 m degrees of freedom per run, with m neighbours.
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
