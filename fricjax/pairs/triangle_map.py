"""Route 3: coefficients from the map of final against initial displacement.

Without damping the map is a triangular wave of period ``4 x_d``, and its amplitude is the static band. With damping
segment n has the slope ``(-1)^n rho^n`` and crosses zero at ``C (rho^-n - 1)`` with ``C = x_d (1 + rho)/(1 - rho)``.
The mass passes from n to n + 1 half-cycles at ``rho^-n (x_s + C) - C``, where the map jumps by ``(1 + rho)(x_s -
x_d)``, and the lines of neighbouring segments meet at the height x_d. A line through each segment gives its zero for
any spacing of the runs.

The zeros, all multiples of one dead band on both sides of one offset, and the slopes of the lines are fitted together
by least squares. All pairs share one scatter about their lines, and with few degrees of freedom its interval is
Student's. With the uncertainties of the rig the degrees of freedom are the effective ones of Welch and Satterthwaite
(JCGM 100, G.4).
"""

import itertools
from typing import Any, NamedTuple

import numpy as np

from ..errors import DataError, check_type
from ..friction import Coulomb
from ..rig import Measured, Rig
from .diagnostics import count_warnings, status_of_counts, student
from .displacements import Pairs, checked_pairs
from .result import RouteFit
from .unwrapping import Unwrapped, amplitude_after, count_half_cycles, decay_ratio, sensitivities

# Fewest different pairs in a segment for a separate slope.
_SLOPED = 3
# Iterations: the zeros about which the slopes act depend on the fitted dead band. Four reach rounding.
_ROUNDS = 4
# Smallest reported scatter [m], so that exact pairs have a standard error.
_ROUNDING = 1e-15


class _Fold(NamedTuple):
    """Pairs folded to one side: starts, alternating ends [m], segments, damping."""

    start: np.ndarray
    end: np.ndarray
    segment: np.ndarray
    rho: float


class _Line(NamedTuple):
    """Separate line of one segment: its number, zero [m] and slope."""

    segment: int
    zero: float
    slope: float


class _Map(NamedTuple):
    """All lines together.

    Attributes:
        band, offset: dead band and equilibrium position [m].
        std: standard error of the dead band [m], inf without degrees of freedom; `dof`: degrees of freedom.
        predicted: final displacements on the lines [m], shape (pairs,).
        offset_fixed: True if the offset could not be separated from friction.
    """

    band: float
    offset: float
    std: float
    dof: int
    predicted: np.ndarray
    offset_fixed: bool


def fit_triangle_map(x0: Any, xf: Any, rig: Rig, *, half_cycles: Any = None) -> RouteFit:
    """Fit mu to the period of the triangle map; bracket mu_s.

    The edges of the map give the bracket.

    Args:
        x0: initial displacements as read from the instrument [m], shape (pairs,), of any sign and in any order.
        xf: final displacements [m], shape (pairs,).
        rig: the machine: stiffness or mass and frequency, damping and load, with their uncertainties.
        half_cycles: number of half-cycles of each pair, shape (pairs,); None: determined from the pairs.

    Returns:
        The fit. Its `extras` hold the dead band, the height at which neighbouring lines meet (again x_d) and the jump
        of the map. They also hold results of formulas that neglect damping and spacing: mu from the period with its
        relative bias by the rig's damping, and mu_s from the largest final displacement.

    Raises:
        UsageError: arrays that do not fit each other.
        DataError: pairs that are not finite, or that reach only the first segment.

    Examples:
        Final displacements of a machine without damping and with a dead band of 0.2 mm:

        >>> import fricjax as fj
        >>> rig = fj.Rig(mass=0.4, stiffness=2500.0, damping=0.0, normal_force=fj.Measured(10.0, 0.1))
        >>> fit = fj.fit_triangle_map([1.1e-3, 1.5e-3, 2.1e-3], [1e-4, -1e-4, -1e-4], rig)
        >>> round(fit.values["mu"], 6), round(fit.combined_std_errors["mu"], 4), fit.half_cycles.tolist()
        (0.05, 0.0005, [3, 4, 5])
    """
    check_type("rig", rig, Rig, "a Rig")
    pairs = checked_pairs(x0, xf, half_cycles, None)
    counts, rho = _counts(pairs, rig)
    if not np.any(counts.half_cycles > 0):
        raise DataError(
            "The mass did not complete a half-cycle in any pair, so the map shows no zero. Release from farther away."
        )
    fitted = _fit_lines(pairs, counts, rho)
    counts = counts._replace(dead_band=fitted.band, offset=fitted.offset)
    y0, yf, band = pairs.x0 - fitted.offset, pairs.xf - fitted.offset, fitted.band
    fold = _Fold(np.abs(y0), np.sign(y0) * yf, counts.half_cycles, rho)
    lines = [_line(fold, int(n)) for n in np.unique(fold.segment) if n > 0]
    per_band = _per_band(rig)
    mu, std = band * per_band, fitted.std * per_band
    # Shift each input of the rig by its standard uncertainty (JCGM 100, 5.1). The map is linear in displacements.
    shifted = [_fit_lines(pairs, *_counts(pairs, r)).band * scale * _per_band(r) for r, scale in rig.shifted()]
    combined = float(np.hypot(std, float(np.linalg.norm(np.subtract(shifted, mu)))))
    half = student(fitted.dof * (combined / std) ** 4 if 0 < std < np.inf else fitted.dof) * combined
    static = _static(fold, band)
    residual = pairs.xf - fitted.predicted
    scatter = float(np.sqrt(np.sum(residual**2) / max(fitted.dof, 1)))
    sigma = np.full(residual.shape, max(scatter, _ROUNDING))
    open_counts = status_of_counts(counts)
    return RouteFit(
        route="triangle map",
        names=("mu",),
        values={"mu": mu, "mu_s": (sum(static) / 2 if np.isfinite(static[1]) else static[0]) * per_band},
        std_errors={"mu": std},
        combined_std_errors={"mu": combined},
        units={"mu": "", "mu_s": ""},
        intervals={"mu": (mu - half, mu + half), "mu_s": (static[0] * per_band, static[1] * per_band)},
        covariance=np.array([[std**2]]),
        flags={"mu": (), "mu_s": ("bracketed, not fitted",)},
        converged=open_counts is None,
        status=open_counts or "converged",
        warnings=(*count_warnings(pairs, counts), *_warnings(rig, lines, fitted)),
        x0=pairs.x0,
        xf=pairs.xf,
        predicted=fitted.predicted,
        half_cycles=counts.half_cycles,
        sigma=sigma,
        sigma_source="scatter of the residuals",
        chi2=float(np.sum((residual / sigma) ** 2)),
        dof=max(fitted.dof, 1),
        extras={
            "dead_band": Measured(band, fitted.std, "m"),
            **_meetings(lines),
            # If one run stopped farther out than another moved on, the edges contradict each other; their difference
            # is then the uncertainty.
            "jump": Measured(
                (1 + rho) * (sum(static) / 2 - band), (1 + rho) * abs(static[1] - static[0]) / 12**0.5, "m"
            ),
            **_naive(lines, fold, band, per_band),
        },
    )


def _per_band(rig: Rig) -> float:
    """Return the coefficient of friction per dead band, k/N [1/m]."""
    machine = rig.oscillator(Coulomb(0.0))
    return float(machine.stiffness) / float(machine.normal_force)


def _counts(pairs: Pairs, rig: Rig) -> tuple[Unwrapped, float]:
    """Return the numbers of half-cycles and the rig's amplitude ratio."""
    rho = decay_ratio(rig.oscillator(Coulomb(0.0)))
    return count_half_cycles(pairs.x0, pairs.xf, pairs.half_cycles, rho, None if pairs.x0.size > 1 else 0.0), rho


def _fit_lines(pairs: Pairs, counts: Unwrapped, rho: float) -> _Map:
    """Fit dead band, offset and slopes of the lines by least squares.

    Pairs that did not move are left out.
    """
    moved, band, offset = counts.half_cycles > 0, counts.dead_band, counts.offset
    x0, n = pairs.x0[moved], counts.half_cycles[moved]
    sign = (-1.0) ** n
    shift = pairs.xf[moved] - sign * rho**n * x0
    both = np.stack(sensitivities(x0, n, rho, offset), axis=1)
    fixed = x0.size < 2 or np.linalg.matrix_rank(both, tol=1e-6 * np.linalg.norm(both)) < 2
    target = shift - offset * both[:, 1] if fixed else shift

    def lines(band: float, offset: float) -> np.ndarray:
        return np.column_stack([both[:, :1] if fixed else both, *_slopes(x0 - offset, n, band, rho)])

    for _ in range(_ROUNDS):
        solution = np.linalg.lstsq(lines(band, offset), target, rcond=None)[0]
        band, offset = float(solution[0]), offset if fixed else float(solution[1])
    columns = lines(band, offset)
    unit = np.linalg.norm(columns, axis=0)
    residual = target - columns / unit @ np.linalg.lstsq(columns / unit, target, rcond=None)[0]
    dof = x0.size - unit.size
    lever = float(np.linalg.inv((columns / unit).T @ (columns / unit))[0, 0] ** 0.5 / unit[0])
    std = max(float(np.sqrt(residual @ residual / dof)), _ROUNDING) * lever if dof > 0 else np.inf
    predicted = pairs.x0.copy()
    predicted[moved] = pairs.xf[moved] - residual
    return _Map(band, offset, std, dof, predicted, fixed)


def _slopes(start: np.ndarray, n: np.ndarray, band: float, rho: float) -> list[np.ndarray]:
    """Return the effect of each segment's slope on the final displacements.

    Only segments with enough pairs are included; a slope acts about the zero of its line.
    """
    return [
        np.where(n == segment, start - np.sign(start) * _zero(int(segment), rho) * band, 0.0)
        for segment in np.unique(n)
        if np.unique(np.abs(start[n == segment])).size >= _SLOPED
    ]


def _line(fold: _Fold, segment: int) -> _Line:
    """Fit a straight line to a segment.

    Its slope follows from the pairs if they determine it, else from the damping.
    """
    chosen = fold.segment == segment
    u, w = fold.start[chosen], fold.end[chosen]
    slope = (-fold.rho) ** segment
    spread = u - u.mean()
    if u.size >= _SLOPED and np.any(spread):
        slope = float(spread @ w / (spread @ spread))
    return _Line(segment, float(u.mean() - w.mean() / slope), slope)


def _zero(segment: int, rho: float) -> float:
    """Return the zero of a segment in dead bands."""
    return float(-amplitude_after(np.asarray(segment), np.asarray(0.0), 1.0, rho) / rho**segment)


def _static(fold: _Fold, band: float) -> tuple[float, float]:
    """Return lower and upper bound of the static band [m].

    They follow from the starts with n and with more than n half-cycles.
    """
    lower, upper = max(band, float(np.max(np.abs(fold.end[fold.segment > 0])))), np.inf
    for n in np.unique(fold.segment):
        beyond = fold.start[fold.segment > n]
        below = fold.start[fold.segment <= n]
        lower = max(lower, float(amplitude_after(n, below.max(), band, fold.rho)))
        if beyond.size:
            upper = min(upper, float(amplitude_after(n, beyond.min(), band, fold.rho)))
    return lower, upper


def _meetings(lines: list[_Line]) -> dict[str, Measured]:
    """Return the mean height at which neighbouring lines meet: the dead band."""
    heights = []
    for left, right in itertools.pairwise(lines):
        if right.segment == left.segment + 1 and right.slope != left.slope:
            at = (left.slope * left.zero - right.slope * right.zero) / (left.slope - right.slope)
            heights.append(abs(left.slope * (at - left.zero)))
    if not heights:
        return {}
    std = float(np.std(heights, ddof=1) / len(heights) ** 0.5) if len(heights) > 1 else np.nan
    return {"height_of_line_intersections": Measured(float(np.mean(heights)), std, "m")}


def _naive(lines: list[_Line], fold: _Fold, band: float, per_band: float) -> dict[str, Measured]:
    """Return the results of formulas without damping, and their bias."""
    largest = float(np.max(np.abs(fold.end[fold.segment > 0])))
    # From the first zero to the last; a single zero counts from the equilibrium.
    first, last = (lines[0] if len(lines) > 1 else _Line(0, 0.0, 1.0)), lines[-1]
    half_cycles = last.segment - first.segment
    spacing = (last.zero - first.zero) / half_cycles
    expected = (_zero(last.segment, fold.rho) - _zero(first.segment, fold.rho)) / half_cycles
    return {
        "mu_from_period_without_damping": Measured(spacing / 2 * per_band, np.nan, ""),
        "bias_of_that_by_damping": Measured(expected / 2 - 1, np.nan, ""),
        "mu_s_from_largest_final_displacement": Measured(largest * per_band, np.nan, ""),
    }


def _warnings(rig: Rig, lines: list[_Line], fitted: _Map) -> list[str]:
    warnings = []
    if fitted.dof < 1:
        warnings.append("As many parameters as pairs: the scatter gives no uncertainty.")
    if fitted.offset_fixed:
        warnings.append(
            "The pairs do not separate an offset of the equilibrium from friction; it is taken as "
            f"{fitted.offset:g} m. Release from both sides, or from farther away."
        )
    if rig.damping is None and rig.damping_ratio is None:
        warnings.append(
            "The rig has no damping, so the map counts as undamped; damping of 0.3 % already biases mu by 3 %."
        )
    if len(lines) == 1:
        warnings.append("The pairs reach one segment only; runs from farther away would check the period.")
    return warnings
