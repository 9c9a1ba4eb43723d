"""Noise models of the runs, and generalised least squares with them.

Correlated noise, drift and hum are identified from the residuals alone (:mod:`~fricjax.estimation.colour`). Floor
vibration is identified from the response of the motion to kicks. It is fitted only if the residuals are correlated in
motion and white at rest. Residuals far larger than the noise are model error, even if a noise model would fit them.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data.segmentation.noise import NORMAL_MAD
from ..estimation.autoregression import autoregression, innovations
from ..estimation.colour import (
    Colour,
    Series,
    autoregressive,
    colour_of,
    instants,
    process_of_noise,
    white,
    whitened,
)
from ..estimation.covariance import Quadratic, quadratic
from ..estimation.loss import Squares
from .diagnostics import worst
from .floor import first_rows, fit_floor_noise, fit_floor_noise_until, passage_of
from .noise import whiteness
from .problem import Problem
from .rows import Rows, Seen, run_in_rows
from .solve import Solution
from .window import Window

# A derivative is independent of the parameters if more than this relative part remains after projecting them out.
# Convention: derivatives are accurate to 1e-9, and independent ones differ by far more.
_INDEPENDENT = 1e-6
# Fewest rows of a rest that determine its noise.
_RESTING = 64
# Fewest rows of a piece of the rest in a whiteness test, and the largest number of pieces.
_PIECE, _PIECES = 32, 8
# Rows on either side of a step in a rest; it is the difference of their means. A slide takes about as many rows, a
# tenth of a half-cycle, because only the highest frequencies of a floor can move a resting mass.
_NEIGHBOURS = 4


def colours_of(problem: Problem, at: Solution, rows: Sequence[Rows], absolute: bool) -> list[Seen]:
    """Fit a noise model to each run.

    `problem.noise` selects the candidates: all models, all except floor vibration, or that alone. The list is empty if
    the noise of all runs is white.
    """
    if problem.noise in ("white", "jitter"):
        return []
    freedom = problem.n_used / problem.dof
    identified = [_identified(row, at.shape.at_bound) for row in rows]
    first = [_without_floor(problem, run, row, freedom * row.level) for run, row in enumerate(identified)]
    stated, seen = absolute and isinstance(problem.loss, Squares), []
    for run, (row, colour) in enumerate(zip(identified, first, strict=True)):
        known = white(row.series, _level(row, stated)) if colour is None else colour
        seen.append(Seen(rows[run], _or_floor_noise(problem, at, run, row, known)))
    return seen if any(first) or any(colour.transition for _, colour in seen) else []


def _identified(row: Rows, at_bound: np.ndarray) -> Rows:
    """Drop derivatives that cannot explain residuals.

    These are derivatives by a coordinate at a bound. An input of the rig, such as the nonlinearity of an
    interferometer, can explain residuals. An input that acts like the free parameters is dropped: it would differ from
    them by rounding only, and pass for an independent function.
    """
    slopes, p = row.series.slopes, at_bound.size
    slopes = np.column_stack([slopes[:, :p] * ~at_bound, slopes[:, p:]])
    unit = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    columns = slopes / unit
    apart = columns[:, p:] - columns[:, :p] @ np.linalg.lstsq(columns[:, :p], columns[:, p:], rcond=1e-9)[0]
    slopes[:, p:] *= np.linalg.norm(apart, axis=0) > _INDEPENDENT
    return row._replace(series=row.series._replace(slopes=slopes))


def _without_floor(problem: Problem, run: int, row: Rows, level: float) -> Colour | None:
    """Return the noise model of a run without floor motion.

    It is None for white noise, and if `problem.noise` is "floor".
    """
    if problem.noise == "floor":
        return None
    if problem.noise == "autoregressive":
        return process_of_noise(row.series, level)
    window = problem.windows[run]
    return colour_of(row.series, level, "drift" not in window.nuisances, window.segmentation.frequency)


def misfit_of(problem: Problem, seen: Sequence[Seen], absolute: bool) -> float:
    """Return the largest residual-to-noise ratio without drift and hum.

    It is the largest over all runs, each overall and in motion.
    """
    sizes = [
        [float(np.sqrt(variance_left(*run, until=time))) for time in (np.inf, window.stopped)]
        for window, run in zip(problem.windows, seen, strict=True)
    ]
    expected = [expected_size(window, *run) for window, run in zip(problem.windows, seen, strict=True)]
    return worst(problem, sizes, expected, not absolute).ratio


def _or_floor_noise(problem: Problem, at: Solution, run: int, row: Rows, colour: Colour) -> Colour:
    """Return the floor model if its Bayesian criterion is lower, else `colour`.

    If `problem.noise` is "floor", return the floor model without a comparison.
    """
    if problem.noise != "auto":
        named = _fit_floor(problem, at, run, row.series) if problem.noise == "floor" else None
        return colour if named is None else named
    still = _at_rest(problem.windows[run], row)
    # The most expensive test comes last; most records have white noise and return here.
    if not (still.any() and _is_correlated(colour.left[~still], row.level) and _is_quiet(colour.left[still])):
        return colour
    floor = _fit_floor(problem, at, run, row.series)
    if floor is None or floor.transition is None:
        return colour
    left = row.series._replace(residual=colour.left)
    known, other = floor, colour if colour.coefficients.size else autoregressive(left)
    if floor.last is not None:
        if floor.last <= row.series.slopes.shape[1]:
            # The floor has moved the mass too far at once: this many parameters fit so few rows without noise.
            return colour
        # Where the floor has moved the mass too far, neither model is valid: compare them on the rows before.
        series, passage = first_rows(row.series, floor.last), floor.transition.first(floor.last)
        known, other = fit_floor_noise_until(series, passage, floor.last), autoregressive(first_rows(left, floor.last))
    return colour if _criterion(known) > _criterion(other) else floor


def _is_quiet(resting: np.ndarray) -> bool:
    """Return True if a rest can separate floor vibration from model error.

    No floor vibration moves the reading at rest. So the rest must be long, and white about a straight line in most
    pieces. A mass that stopped near the edge of its dead band may slide now and then. Only the stretches between slides
    are tested: correlated noise is present in all of them.
    """
    if resting.size < _RESTING:
        return False
    stretches = [stretch for stretch in _between_slides(resting) if stretch.size >= _PIECE]
    pieces = [piece for stretch in stretches for piece in np.array_split(stretch, min(stretch.size // _PIECE, _PIECES))]
    return sum(map(_is_white, pieces)) > len(pieces) / 2


def _between_slides(resting: np.ndarray) -> list[np.ndarray]:
    """Split a rest at its steps, and drop the rows near them.

    A step is an outlier among the differences of adjacent means. Medians are used, so steady noise and drift have no
    outliers.
    """
    sums, ends = np.concatenate([[0.0], np.cumsum(resting)]), np.arange(_NEIGHBOURS, resting.size - _NEIGHBOURS + 1)
    steps = sums[ends + _NEIGHBOURS] - 2 * sums[ends] + sums[ends - _NEIGHBOURS]
    off = np.abs(steps - np.median(steps))
    still = np.ones(resting.size + 2, bool)
    for end in ends[off > thresholds.EXTREME * np.median(off) / NORMAL_MAD]:
        still[end - _NEIGHBOURS + 1 : end + _NEIGHBOURS + 1] = False
    still[[0, -1]] = False
    edges = np.flatnonzero(np.diff(still))
    return [resting[begin:end] for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def _is_white(rows: np.ndarray) -> bool:
    line = np.polynomial.Polynomial.fit(np.arange(rows.size), rows, 1)(np.arange(rows.size))
    return autoregression(rows - line, np.zeros(1, int))[0].size == 0


def _is_correlated(moving: np.ndarray, level: float) -> bool:
    """Return True if residuals in motion are correlated or too large.

    A long rest would hide this.
    """
    if moving.size == 0:
        return False
    larger = np.mean(moving**2) > level * (1 + thresholds.SURE * np.sqrt(2 / moving.size))
    return bool(larger or autoregression(moving, np.zeros(1, int))[0].size)


def _fit_floor(problem: Problem, at: Solution, run: int, series: Series) -> Colour | None:
    passage = passage_of(problem, at, run, series.t)
    return None if passage is None else fit_floor_noise(series, passage)


def _criterion(colour: Colour) -> float:
    """Return the Bayesian information criterion of a noise model.

    The initial state of the process is ignored, because model error starts like floor vibration.
    """
    size = colour.log_determinant - (colour.spread if colour.transition is None else 0.0)
    return size + np.log(colour.left.size) * colour.n_parameters


def remembered(rows: Rows, colour: Colour) -> float:
    """Return the number of samples that carry the information of one.

    It is the spectral density at zero frequency over that of independent samples.
    """
    fading = max(1 - float(np.sum(colour.coefficients)), np.finfo(float).eps)
    return min(max((colour.std / fading) ** 2 / rows.level, 1.0), rows.series.t.size * rows.samples / 2)


class UnderNoise(NamedTuple):
    """A fit weighted by the noise models of another fit.

    Both fits have the same samples.

    Attributes:
        misfit: minimum of the sum of squares of rows and priors, weighted by the noise.
        shape: the quadratic model that leads from the fit to that minimum.
        times, residuals: of the rows of each run at the minimum; residuals have unit variance.
    """

    misfit: float
    shape: Quadratic
    times: list[np.ndarray]
    residuals: list[np.ndarray]


def under_noise(problem: Problem, solution: Solution, seen: Sequence[Seen]) -> UnderNoise:
    """Return the fit weighted by one noise model for each run."""
    pairs = enumerate(seen)
    runs = [Seen(run_in_rows(problem, solution.evaluation, run, like.rows.samples), like.colour) for run, like in pairs]
    counted = weighed_rows(runs)
    shape, *_ = least_squares(problem, solution, counted)
    priors = (solution.derived.values - problem.residual.prior_mean) * problem.residual.prior_weight
    squares = sum(float(np.sum(residual**2)) for residual, _ in counted) + float(priors @ priors)
    step = np.concatenate([shape.step, np.zeros(solution.y.size - shape.step.size)])
    left = [residual + slopes @ step for residual, slopes in counted[: len(runs)]]
    times = [instants(row.series, colour) for row, colour in runs]
    return UnderNoise(squares - shape.distance**2, shape, times, left)


Weighed = tuple[np.ndarray, np.ndarray]
"""Residuals of unit variance, shape (n,), and their derivatives by the coordinates, shape (n, p)."""


def weighed_rows(seen: Sequence[Seen]) -> list[Weighed]:
    """Return whitened rows of each run, and the mean of correlated noise.

    The mean is in units of the noise. Noise of long memory hardly determines its mean, so this row centres the fit in
    its record.
    """
    rows = [whitened(row.series, colour) for row, colour in seen]
    for series, colour in ((row.series, colour) for row, colour in seen if colour.coefficients.size):
        residual, size = series.residual + colour.beside @ colour.sizes, float(np.std(colour.left / series.unit))
        middle = series.unit / (series.unit @ series.unit) / size
        rows.append((middle[None] @ residual, middle[None] @ series.slopes))
    return rows


def least_squares(
    problem: Problem, at: Solution, counted: Iterable[Weighed]
) -> tuple[Quadratic, np.ndarray, np.ndarray]:
    """Return quadratic model, gradient and normal matrix of weighted residuals and priors."""
    residual, limits = problem.residual, problem.limits
    p, n = residual.n_parameters, at.y.size
    weight = np.asarray(residual.prior_weight)
    slope = np.pad(at.derived.slope * weight, (0, n - p))
    normal = np.diag(slope**2)
    gradient = slope * np.pad((at.derived.values - residual.prior_mean) * weight, (0, n - p))
    for r, slopes in counted:
        gradient, normal = gradient + slopes.T @ r, normal + slopes.T @ slopes
    y, down = at.y[:p], gradient[:p]
    at_bound = ((y <= limits.lower) & (down >= 0)) | ((y >= limits.upper) & (down <= 0))
    return quadratic(down, normal[:p, :p], at_bound), gradient, normal


def variance_left(row: Rows, colour: Colour, until: float = np.inf) -> float:
    """Return the variance of samples without drift, hum and mean.

    It is relative to the stated one. `until` is the last time [s]. Drift and hum are subtracted from the samples,
    because rows do not show all of them. The other reduction in the rows is motion that the next step of the fit
    removes.
    """
    series, used = row.series, (row.weight > 0) & (row.t <= until)
    samples = (row.left + colour.at(row.t, series.t) * row.weight)[used]
    before = series.residual + colour.beside @ colour.sizes
    after = colour.left
    if colour.coefficients.size:
        # The mean of noise with long memory carries no information.
        after = after - series.unit * (series.unit @ after) / (series.unit @ series.unit)
    moved = float(np.mean((before**2 - after**2)[series.t <= until])) / row.samples
    return max(float(np.mean(samples**2)) - moved, 0.0)


def expected_size(window: Window, row: Rows, colour: Colour) -> float:
    """Return the noise level at rest, extrapolated to the whole run.

    It is a standard deviation relative to the stated one; zero if unknown. Slowly varying noise is larger over a run
    than in a piece of it. It may be noise if its innovations, with the process fitted at rest, are not larger in motion
    than at rest.
    """
    if colour.transition is not None:
        size = whiteness(whitened(row.series._replace(residual=colour.left), colour)[0]).white
        return float(np.sqrt(variance_left(row, colour))) if size else 0.0
    still = _at_rest(window, row)
    if np.sum(still) < _RESTING or still.all():
        return 0.0
    begin = np.zeros(1, int)
    coefficients, _ = autoregression(colour.left[still], begin)
    # Skip the first rows, which the release may have excited.
    parts = [innovations(colour.left[part, None], begin, coefficients) for part in (~still, still)]
    moving, resting = (part[coefficients.size :] for part in parts)
    # Medians ignore spikes in the rest, which are no slow noise. A random walk grows with the square root of time.
    parts = resting, colour.left[still]
    typical, seen = (float(np.median(np.abs(part - np.median(part)))) / NORMAL_MAD for part in parts)
    size = np.sqrt(variance_left(row, colour)) * typical / max(np.std(moving), np.finfo(float).tiny)
    return float(min(size, seen * np.sqrt(still.size / np.sum(still) / row.samples)))


def _at_rest(window: Window, row: Rows) -> np.ndarray:
    """Return True for rows in the rest."""
    return row.series.t > window.stopped


def _level(row: Rows, stated: bool) -> float:
    """Return the variance of white noise; `stated` if the residuals allow it."""
    enough = 1 + thresholds.SURE * np.sqrt(2 / (row.series.t.size * row.samples))
    return 1.0 if stated and row.level < enough else row.level
