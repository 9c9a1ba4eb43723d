"""Route 3: coefficients from the shape of the map of final against initial displacement.

Without damping the map is a triangular wave of period ``4 x_d`` whose amplitude is the static band. With damping its
segment n has the slope ``(-1)^n rho^n`` and crosses zero at ``C (rho^-n - 1)`` with ``C = x_d (1 + rho)/(1 - rho)``.
The mass passes from n to n + 1 half-cycles at ``rho^-n (x_s + C) - C``, where the map jumps by ``(1 + rho)(x_s -
x_d)``, and the lines of neighbouring segments meet at the height x_d. A line through each segment gives its zero,
whatever the spacing of the runs.
"""

import itertools
from typing import Any, NamedTuple

import numpy as np

from ..calibrate import Rig
from ..data.errors import DataError
from ..estimation.covariance import COVERAGE
from ..friction import Coulomb
from .half_cycles import Unwrapped, amplitude_after, counted, decay_ratio
from .pairs import Pairs, checked_pairs
from .result import Estimate, RouteFit


class _Fold(NamedTuple):
    """Pairs folded to one side: distance of the start and alternating end [m], their segment, and the damping."""

    start: np.ndarray
    end: np.ndarray
    segment: np.ndarray
    rho: float


class _Line(NamedTuple):
    """Line of one segment: its number, zero and slope, and the standard deviation of the zero [m]."""

    segment: int
    zero: float
    slope: float
    std: float


def fit_triangle_map(x0: Any, xf: Any, rig: Rig, *, half_cycles: Any = None) -> RouteFit:
    """Fit mu to the period of the triangle map, and bracket mu_s by its edges.

    Args:
        x0: initial displacements in the reading of the instrument [m], shape (pairs,), of any sign and in any order.
        xf: final displacements [m], shape (pairs,).
        rig: the machine: stiffness or mass and frequency, damping and load, with their uncertainties.
        half_cycles: number of half-cycles of each pair, shape (pairs,); None: found from the pairs.

    Returns:
        The fit. Its `extras` hold the dead band, the height at which neighbouring lines meet (x_d again), the jump of
        the map, and beside them the formulas that neglect damping and spacing: mu from the period and mu_s from the
        largest final displacement, with the relative bias of the former as the rig's damping explains it.

    Raises:
        UsageError: arrays that do not fit each other.
        DataError: pairs that are not finite, or that reach no segment behind the first.
    """
    pairs = checked_pairs(x0, xf, half_cycles, None)
    found, fold = _folded(pairs, rig)
    lines = [_line(fold, int(n)) for n in np.unique(fold.segment) if n > 0]
    if not lines:
        raise DataError(
            "In none of the pairs did the mass complete a half-cycle, so the map shows no zero. Release from farther "
            "away."
        )
    band, std = _dead_band(lines, fold)
    mu = band * _per_band(rig)
    combined = float(np.hypot(std * _per_band(rig), _by_rig(pairs, rig, mu)))
    static = _static(fold, band)
    predicted = _predicted(pairs.x0, found, fold, band)
    residual = pairs.xf - predicted
    scatter = float(np.sqrt(np.sum(residual**2) / max(residual.size - 2, 1)))
    sigma = np.full(residual.shape, max(scatter, 1e-15))
    return RouteFit(
        route="triangle map",
        names=("mu",),
        values={
            "mu": mu,
            "mu_s": sum(static) / 2 * _per_band(rig) if np.isfinite(static[1]) else static[0] * _per_band(rig),
        },
        std_errors={"mu": combined},
        units={"mu": "", "mu_s": ""},
        intervals={
            "mu": (mu - COVERAGE * combined, mu + COVERAGE * combined),
            "mu_s": (static[0] * _per_band(rig), static[1] * _per_band(rig)),
        },
        covariance=np.array([[combined**2]]),
        flags={"mu": (), "mu_s": ("bracketed, not fitted",)},
        converged=True,
        status="converged",
        warnings=tuple(_warnings(rig, lines)),
        x0=pairs.x0,
        xf=pairs.xf,
        predicted=predicted,
        half_cycles=found.half_cycles,
        sigma=sigma,
        sigma_source="scatter of the residuals",
        chi2=float(np.sum((residual / sigma) ** 2)),
        dof=max(residual.size - 2, 1),
        extras={
            "dead_band": (band, std, "m"),
            **_meetings(lines),
            "jump": (
                (1 + fold.rho) * (sum(static) / 2 - band),
                (1 + fold.rho) * (static[1] - static[0]) / 12**0.5,
                "m",
            ),
            **_naive(lines, fold, band, _per_band(rig)),
        },
    )


def _per_band(rig: Rig) -> float:
    """Coefficient of friction per dead band, k/N [1/m]."""
    machine = rig.oscillator(Coulomb(0.0))
    return float(machine.stiffness) / float(machine.normal_force)


def _folded(pairs: Pairs, rig: Rig) -> tuple[Unwrapped, _Fold]:
    rho = decay_ratio(rig.oscillator(Coulomb(0.0)))
    found = counted(pairs.x0, pairs.xf, pairs.half_cycles, rho, None if pairs.x0.size > 1 else 0.0)
    y0, yf = pairs.x0 - found.offset, pairs.xf - found.offset
    return found, _Fold(np.abs(y0), np.sign(y0) * yf, found.half_cycles, rho)


def _line(fold: _Fold, segment: int) -> _Line:
    """Straight line through a segment: with its own slope where its pairs tell one, else with that of the damping."""
    chosen = fold.segment == segment
    u, w = fold.start[chosen], fold.end[chosen]
    slope = (-fold.rho) ** segment
    spread = u - u.mean()
    if u.size >= 3 and np.any(spread):
        slope = float(spread @ w / (spread @ spread))
    zeros = u - w / slope
    zero = float(u.mean() - w.mean() / slope)
    leverage = 1 / u.size + ((zero - u.mean()) ** 2 / (spread @ spread) if u.size >= 3 else 0.0)
    scatter = float(np.std(zeros - zero, ddof=2)) if u.size >= 3 else np.inf
    return _Line(segment, zero, slope, float(scatter * leverage**0.5))


def _weight(segment: int, rho: float) -> float:
    """Zero of a segment in dead bands."""
    return float(-amplitude_after(np.asarray(segment), np.asarray(0.0), 1.0, rho) / rho**segment)


def _dead_band(lines: list[_Line], fold: _Fold) -> tuple[float, float]:
    """Weighted mean of the dead bands that the zeros give, and its standard error from their scatter [m]."""
    size = np.array([_weight(line.segment, fold.rho) for line in lines])
    bands = np.array([line.zero for line in lines]) / size
    std = np.array([line.std for line in lines]) / size
    known = np.isfinite(std) & (std > 0)
    weights = 1 / std[known] ** 2 if known.any() else size**2
    used = bands[known] if known.any() else bands
    mean = float(np.sum(weights * used) / weights.sum())
    if used.size == 1:
        return mean, float(std[known][0]) if known.any() else np.inf
    spread = float(np.sqrt(np.sum(weights * (used - mean) ** 2) / weights.sum() / (used.size - 1)))
    return mean, max(spread, float(weights.sum() ** -0.5)) if known.any() else spread


def _by_rig(pairs: Pairs, rig: Rig, mu: float) -> float:
    """Standard uncertainty of mu by the rig's inputs, each shifted by its own (JCGM 100, 5.1)."""
    shifts = []
    for name, value in rig.inputs().items():
        other = rig.with_inputs({name: value.value + value.std})
        _, fold = _folded(pairs, other)
        lines = [_line(fold, int(n)) for n in np.unique(fold.segment) if n > 0]
        shifts.append(_dead_band(lines, fold)[0] * _per_band(other) - mu)
    return float(np.linalg.norm(shifts))


def _static(fold: _Fold, band: float) -> tuple[float, float]:
    """Static band between the starts from which the mass made n and more than n half-cycles [m]."""
    lower, upper = max(band, float(np.max(np.abs(fold.end[fold.segment > 0])))), np.inf
    for n in np.unique(fold.segment):
        beyond = fold.start[fold.segment > n]
        below = fold.start[fold.segment <= n]
        lower = max(lower, float(amplitude_after(n, below.max(), band, fold.rho)))
        if beyond.size:
            upper = min(upper, float(amplitude_after(n, beyond.min(), band, fold.rho)))
    return lower, upper


def _meetings(lines: list[_Line]) -> dict[str, Estimate]:
    """Mean height at which the lines of neighbouring segments meet: the dead band once more."""
    heights = []
    for left, right in itertools.pairwise(lines):
        if right.segment == left.segment + 1 and right.slope != left.slope:
            at = (left.slope * left.zero - right.slope * right.zero) / (left.slope - right.slope)
            heights.append(abs(left.slope * (at - left.zero)))
    if not heights:
        return {}
    std = float(np.std(heights, ddof=1) / len(heights) ** 0.5) if len(heights) > 1 else None
    return {"height_of_line_intersections": (float(np.mean(heights)), std, "m")}


def _naive(lines: list[_Line], fold: _Fold, band: float, per_band: float) -> dict[str, Estimate]:
    """The formulas without damping, and what the damping makes the first one err by."""
    largest = float(np.max(np.abs(fold.end[fold.segment > 0])))
    first, last = lines[0], lines[-1]
    strokes = last.segment - first.segment if len(lines) > 1 else first.segment
    spacing = (last.zero - first.zero if len(lines) > 1 else first.zero) / strokes
    ends = [_weight(line.segment, fold.rho) for line in (first, last)]
    expected = (ends[1] - ends[0] if len(lines) > 1 else ends[0]) / strokes
    return {
        "mu_from_period_without_damping": (spacing / 2 * per_band, None, ""),
        "bias_of_that_by_damping": (expected / 2 - 1, None, ""),
        "mu_s_from_largest_final_displacement": (largest * per_band, None, ""),
    }


def _predicted(x0: np.ndarray, found: Unwrapped, fold: _Fold, band: float) -> np.ndarray:
    n = found.half_cycles
    amplitude = amplitude_after(n, fold.start, band, fold.rho)
    return found.offset + np.sign(x0 - found.offset) * (-1.0) ** n * amplitude


def _warnings(rig: Rig, lines: list[_Line]) -> list[str]:
    said = []
    if rig.damping is None and rig.damping_ratio is None:
        said.append(
            "The rig has no damping, so the map is taken for undamped; damping of 0.3 % already biases mu by 3 %."
        )
    if len(lines) == 1:
        said.append("The pairs reach one segment only; runs from farther away would check the period.")
    return said
