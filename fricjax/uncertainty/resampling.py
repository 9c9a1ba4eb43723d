"""Bootstrap: scatter of the fitted values over resampled records.

Blocks of the residuals are drawn with replacement and added to the fitted motion. They keep the correlation of the
noise within a block and assume no distribution (Kuensch, Ann. Statist. 17, 1217, 1989). Their length is that of
Carlstein for an autoregression with the correlation time of the residuals, ``(sqrt(6) r/(1 - r^2))^(2/3) n^(1/3)``
(Ann. Statist. 14, 1171, 1986).
"""

import dataclasses
import math

import numpy as np

from ..errors import UsageError, check_choice, check_type
from ..fitting import Fit
from ..fitting.diagnostics import optimum_found
from ..fitting.noise import Noise, whiteness
from ..fitting.problem import Problem, displaced
from ..fitting.window import Window
from ..show import Cell, Report, Table, interval, plain, uncertain
from ..show.working import working
from .again import optimum, problem_of, solved
from .draws import AbstractDraws

NOISES = ("blocks", "model")
# Fewest records for quantiles of 2.5 %: one beyond each end.
_FEWEST, _MOST = 40, 1_000_000


@dataclasses.dataclass(frozen=True, eq=False)
class Bootstrap(AbstractDraws):
    """Fits of resampled records.

    Attributes:
        names: free parameters; `units`: by name.
        sample: fitted values, NaN where a fit has no optimum, shape (draws, p).
        values, std_errors: values and standard errors of the original fit, by name.
        noise: "blocks" or "model"; `block`: length of the blocks of each run, in samples.
        failed: number of fits without an optimum.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> check = fj.uncertainty.bootstrap(fit, 64)
        >>> check.failed, bool(0.7 < check.std["mu"] / fit.std_errors["mu"] < 1.4)
        (0, True)
    """

    noise: str
    block: tuple[int, ...]

    @property
    def failed(self) -> int:
        """Number of fits without an optimum."""
        return int(np.sum(~np.isfinite(self.sample[:, 0])))

    @property
    def good(self) -> np.ndarray:
        """Values of the fits with an optimum, shape (n, p)."""
        return self.sample[np.isfinite(self.sample[:, 0])]

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the values over the draws, shape (p, p)."""
        return np.cov(self.good, rowvar=False, ddof=1)

    @property
    def bias(self) -> dict[str, float]:
        """Mean of each value over the draws, minus the original value."""
        means = zip(self.names, self.good.mean(axis=0).tolist(), strict=True)
        return {name: mean - self.values[name] for name, mean in means}

    def report(self) -> Report:
        """Return the scatter of the draws and its ratio to the errors."""
        std, bias, rows = self.std, self.bias, []
        for name, (low, high) in self.intervals().items():
            ratio = std[name] / self.std_errors[name] if self.std_errors[name] else math.nan
            value = Cell(uncertain(self.values[name], std[name]), value=self.values[name], std=std[name])
            compared = [Cell(f"{ratio:.2f}", ratio=ratio), Cell(plain(bias[name], 3), bias=bias[name])]
            between = Cell(interval(low, high), low=low, high=high)
            rows.append([name, value, self.units[name], *compared, between])
        heads = ["Parameter", "Value (scatter of the draws)", "Unit", "Scatter/standard error", "Bias", "95 % interval"]
        how = "residuals in blocks" if self.noise == "blocks" else "noise drawn from its model"
        blocks = f" of {', '.join(map(str, self.block))} samples" if self.noise == "blocks" else ""
        facts = [
            ("resampled", how + blocks),
            ("draws", f"{len(self.sample)}, {self.failed} of them without an optimum"),
        ]
        names = ("names", "values", "std_errors", "noise", "block", "failed", "std", "bias", "covariance")
        data = {name: getattr(self, name) for name in names} | {"intervals": self.intervals()}
        return Report([Table(heads, rows, "Bootstrap")], facts, data=data)


@working("Resampling")
def bootstrap(fit: Fit, draws: int = 1000, *, noise: str = "blocks", seed: int = 0) -> Bootstrap:
    """Fit resampled records, many in parallel.

    Args:
        fit: the fit to resample; not one that was read from a file.
        draws: number of records.
        noise: "blocks": residuals of the fit in blocks; "model": normal noise of the size that the fit has found,
            rounded like the reading. The model needs uncorrelated noise.
        seed: seed of the generator; the same seed gives the same numbers.

    Returns:
        The fitted values of all draws, and the fit. If the fit found white noise, all records are fitted by least
        squares. Otherwise the noise of each record is estimated again.

    Raises:
        UsageError: the fit has no optimum or is from a file, there are too few draws, or the noise has no simple model.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fj.uncertainty.bootstrap(fit, 64, noise="model").sample.shape
        (64, 6)
    """
    problem, values = problem_of(fit), optimum(fit)
    check_choice("noise", noise, NOISES)
    check_type("draws", draws, (int, np.integer), "a number of draws")
    if draws < _FEWEST:
        raise UsageError(f"{draws} draws are too few for an interval of 95 %. Take {_FEWEST} at least, better 1000.")
    if draws > _MOST:
        raise UsageError(f"{draws} draws take too long. Take {_MOST} at most; 1000 are enough.")
    parts = [_split(*each) for each in zip(problem.windows, fit.residuals_by_run, fit.noises, strict=True)]
    blocks = tuple(_block_length(random) for _, random in parts)
    if noise == "model":
        for each, label in zip(fit.noises, fit.labels, strict=True):
            _check_drawable(each, label)

    if all(noise.white for noise in fit.noises):
        # The fit found white noise and used least squares. The resampled records are fitted in the same way.
        problem = dataclasses.replace(problem, noise="white")
    measured = displaced(problem)

    def resampled(number: int) -> Problem:
        # Each record has a separate generator, so that the order of the fits does not matter.
        generator = np.random.default_rng([seed, number])
        rows = zip(problem.windows, parts, fit.noises, blocks, strict=True)
        return measured([_drawn(generator, noise, *row) for row in rows])

    rows = solved(resampled, draws, problem.residual.space.coordinates(values))
    fitted = [
        np.asarray(row.weighted.solution.derived.values) + problem.origins
        if row.weighted is not None and optimum_found(row.status)
        else np.full(len(problem.names), np.nan)
        for row in rows
    ]
    known = {name: fit.values[name] for name in fit.names}
    units = {name: fit.units[name] for name in fit.names}
    return Bootstrap(problem.names, units, np.array(fitted), known, dict(fit.std_errors), noise, blocks)


def _split(window: Window, residual: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Split the record into a smooth part and random noise."""
    t = np.asarray(window.trace.t) - window.origin
    random = (residual - noise.at(t))[window.used]
    known = np.array(window.trace.x)
    known[window.used] -= random
    return known, random - random.mean()


def _block_length(random: np.ndarray) -> int:
    time = whiteness(random).correlation_time
    r = (time - 1) / (time + 1)
    return int(
        np.clip(math.ceil((math.sqrt(6) * r / (1 - r**2)) ** (2 / 3) * random.size ** (1 / 3)), 1, random.size // 4)
    )


def _check_drawable(noise: Noise, label: str) -> None:
    """Refuse noise without a simple model.

    Raises:
        UsageError: the noise is correlated, of the floor, or jitter.
    """
    # A fit knows the correlation of averages only, about forty per half-cycle. At shorter lags it is unknown.
    kinds = {"correlated": noise.memory, "vibration of the floor": noise.floor, "jitter": noise.jitter}
    for kind, is_it in kinds.items():
        if is_it:
            raise UsageError(f"The noise of {label} is {kind} and has no simple model. Take noise='blocks'.")


def _drawn(
    generator: np.random.Generator,
    kind: str,
    window: Window,
    part: tuple[np.ndarray, np.ndarray],
    noise: Noise,
    block: int,
) -> np.ndarray:
    """Return the displacements of a resampled record."""
    known, random = part
    n, x = random.size, known.copy()
    if kind == "blocks":
        # Blocks continue from the end at the start, so that all residuals are drawn with equal probability.
        starts = generator.integers(0, n, -(-n // block))
        x[window.used] += random[(starts[:, None] + np.arange(block)).ravel()[:n] % n]
        return x
    drawn = generator.normal(size=n)
    # The size of the residuals includes rounding. Remove it here, because the sum is rounded again.
    size = noise.excess * window.sigma[window.used]
    if noise.rounding:
        size = np.sqrt(np.maximum(size**2 - noise.rounding**2 / 12, 0.0))
    x[window.used] += size * drawn
    if noise.rounding:
        x[window.used] = noise.rounding * np.round(x[window.used] / noise.rounding)
    return x
