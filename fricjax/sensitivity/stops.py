"""The next release for the static coefficient, chosen by the expected stop.

At a reversal the mass stays if the spring force is smaller than static friction. So each reversal tests one question on
mu_s: is it above ``|R(a)|/N``? The release, dynamic friction and damping determine the turning points, and thus the
questions of a run. The best release leaves the smallest expected variance of mu_s (Lindley, Ann. Math. Stat. 27, 986,
1956, for a quadratic loss). Without scatter it halves the interval of mu_s.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..errors import UsageError
from ..oscillator import Oscillator, ready
from ..pairs.static import reversals_of
from ..show import Cell, Report, Reported, Style, Table, axis_label, engineering, figure, plain, scaled, styled

# Number of values of mu_s and of releases in the search, which resolve a few thousandths of the interval.
_GRID, _RELEASES = 400, 801
# Range of static friction about mu_s, in standard deviations of its scatter.
_FAR = 6.0
# Number of outcomes in the report.
_LISTED = 4


class Outcome(NamedTuple):
    """Possible outcome of a run.

    Attributes:
        half_cycles: number of half-cycles until the stop.
        displacement: displacement of the stop from the equilibrium [m].
        probability: probability of the outcome.
        value, std: mu_s and its standard uncertainty after the outcome.

    Examples:
        >>> Outcome(half_cycles=4, displacement=-1.3e-4, probability=0.5, value=0.0575, std=0.0043).half_cycles
        4
    """

    half_cycles: int
    displacement: float
    probability: float
    value: float
    std: float


@dataclasses.dataclass(frozen=True, eq=False)
class NextRelease(Reported):
    """The most informative release for static friction.

    Attributes:
        x0: displacement from the equilibrium at release [m].
        value, std: mu_s and its standard uncertainty before the run, with equal probability over its interval.
        expected_std: root of the expected variance after the run.
        outcomes: possible outcomes of the run, the most probable first.
        releases, expected: the releases of the search [m] and the `expected_std` of each, shape (n,).

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> best = fj.sensitivity.next_release(machine, (0.5e-3, 2e-3), (0.05, 0.07))
        >>> round(best.expected_std / best.std, 2), [round(each.probability, 1) for each in best.outcomes]
        (0.5, [0.5, 0.5])
    """

    x0: float
    value: float
    std: float
    expected_std: float
    outcomes: tuple[Outcome, ...]
    releases: np.ndarray
    expected: np.ndarray

    def report(self) -> Report:
        """Return the release and the possible outcomes."""
        rows = []
        for each in self.outcomes:
            rows.append(
                [
                    Cell(each.half_cycles, half_cycles=each.half_cycles),
                    Cell(engineering(each.displacement, "m", 4), displacement=each.displacement),
                    Cell(f"{each.probability:.2f}", probability=each.probability),
                    Cell(plain(each.value, 4), value=each.value),
                    Cell(f"{100 * each.std / each.value:.2g} %", std=each.std),
                ]
            )
        heads = ["Stops after half-cycles", "At", "Probability", "Then mu_s", "Then its uncertainty"]
        relative = lambda std: f"{100 * std / self.value:.2g} %"
        facts = [
            ("release from", engineering(self.x0, "m", 5)),
            ("mu_s now", f"{plain(self.value, 4)}, standard uncertainty {relative(self.std)}"),
            ("after the run", f"standard uncertainty {relative(self.expected_std)} expected"),
        ]
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        table = Table(heads, rows, "The most informative release for mu_s", {"displacement": "m"}, _LISTED)
        return Report([table], facts, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the expected standard uncertainty of mu_s against the release, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis = axes[0, 0]
        releases, unit = scaled(self.releases, "m")
        axis.plot(releases, 100 * self.expected / self.value)
        axis.axhline(100 * self.std / self.value, color="#000000", linestyle="--", linewidth=0.8)
        axis.plot(self.x0 * releases[-1] / self.releases[-1], 100 * self.expected_std / self.value, "o")
        axis.set_xlabel(axis_label("Release", unit))
        axis.set_ylabel(axis_label("Expected u(mu_s)", "%"))
        return styled(drawing, style)


def next_release(
    oscillator: Oscillator, x0: tuple[float, float], interval: tuple[float, float], *, scatter: float = 0.0
) -> NextRelease:
    """Find the most informative next release for the static coefficient.

    Args:
        oscillator: the machine with the present estimates of dynamic coefficient and damping.
        x0: smallest and largest displacement from the equilibrium at release [m].
        interval: interval of mu_s, e.g. `fit.intervals["mu_s"]`; before the first run, guess a wide one above mu.
        scatter: relative standard deviation of static friction from stop to stop.

    Returns:
        The release, and its possible outcomes.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: the ends of a range are not valid, or stops do not determine a static coefficient of this law.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> print(fj.sensitivity.next_release(machine, (0.5e-3, 2e-3), (0.05, 0.07)).summary())
        The most informative release for mu_s
        Stops after half-cycles  At           Probability  Then mu_s  Then its uncertainty
        ...
    """
    ready()
    if not oscillator.friction.set_valued:
        raise UsageError(
            f"Under {type(oscillator.friction).__name__} a stop determines no static coefficient. Take Coulomb."
        )
    for name, (low, high), unit in (("x0", x0, " [m]"), ("interval", interval, "")):
        if not 0 < low < high < math.inf:
            raise UsageError(f"{name} must be a smaller and a larger positive number{unit}, got {low} and {high}.")
    if not 0 <= scatter < 1:
        raise UsageError(f"The scatter must be a part such as 0.02, got {scatter:g}.")
    releases = np.linspace(*x0, _RELEASES)
    mu_s = interval[0] + (interval[1] - interval[0]) * (np.arange(_GRID) + 0.5) / _GRID
    asked, points, counts = _questions(oscillator, releases, interval[0], interval[1] * (1 + _FAR * scatter))
    stops = _stops(asked, mu_s, scatter)
    probability = stops.mean(axis=2)
    weight = np.where(probability > 0, probability, 1.0)
    mean = (stops @ mu_s) / _GRID / weight
    variance = np.maximum((stops @ mu_s**2) / _GRID / weight - mean**2, 0.0)
    expected = np.sqrt(np.sum(probability * variance, axis=1))
    best = int(np.argmin(expected))
    columns = (counts, points, probability, mean, np.sqrt(variance))
    rows = zip(*(each[best] for each in columns), strict=True)
    outcomes = [Outcome(int(count), *map(float, numbers)) for count, *numbers in rows]
    chosen = sorted((each for each in outcomes if each.probability > 1 / _GRID), key=lambda each: -each.probability)
    middle, std = sum(interval) / 2, (interval[1] - interval[0]) / math.sqrt(12)
    return NextRelease(float(releases[best]), middle, std, float(expected[best]), tuple(chosen), releases, expected)


def _questions(machine: Oscillator, releases: np.ndarray, low: float, high: float) -> tuple[np.ndarray, ...]:
    """Return the mu_s that would hold the mass at each reversal.

    The reversals are the last ones. At earlier reversals even the highest value would not hold the mass. At the last
    one the lowest value would.

    Returns:
        These coefficients, the turning points [m] and their numbers, each of shape (releases, points).
    """
    most = math.ceil(float(releases[-1]) / (2 * float(machine.dead_band))) + 2
    points = reversals_of(machine, releases, np.full(releases.size, most))[:, : most + 1]
    asked = np.abs(np.asarray(machine.restoring_force(jnp.asarray(points)))) / float(machine.normal_force)
    first, last = np.argmax(asked <= high, axis=1), np.argmax(asked <= low, axis=1)
    numbers = first[:, None] + np.arange(int(np.max(last - first)) + 1)
    asked, points = (np.take_along_axis(each, np.minimum(numbers, most), axis=1) for each in (asked, points))
    return np.where(numbers < last[:, None], asked, 0.0), points, numbers


def _stops(asked: np.ndarray, mu_s: np.ndarray, scatter: float) -> np.ndarray:
    """Return the probability of a stop, shape (releases, points, values).

    Args:
        asked: coefficient that holds the mass, shape (releases, points).
        mu_s: values of the static coefficient, shape (values,).
        scatter: relative standard deviation of static friction.
    """
    from scipy.special import ndtr

    # Without scatter the normal distribution is a step.
    with np.errstate(divide="ignore", invalid="ignore"):
        deviations = (mu_s / asked[:, :, None] - 1) / scatter if scatter else np.inf * (mu_s - asked[:, :, None])
    stays = ndtr(np.where(asked[:, :, None] == 0, np.inf, deviations))
    moves_on = np.cumprod(1 - stays, axis=1)
    return stays * np.concatenate([np.ones_like(stays[:, :1]), moves_on[:, :-1]], axis=1)
