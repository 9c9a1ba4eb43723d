"""The equation of motion in weak form: no derivative of the data, and every coefficient linear.

Multiplied by a smooth function phi that vanishes with its slope at both ends, and integrated by parts, the motion under
Coulomb and viscous friction on a linear spring obeys

    int phi'' x - 2 zeta omega int phi' x + omega^2 int phi x - omega^2 b int phi + (F/m) int phi sgn(v) = 0.

The integrand of the last jumps at the reversals: it is split there, and each part is known in closed form (modulating
functions: Shinbrot 1957).
"""

from typing import Any, NamedTuple

import numpy as np

from ..oscillator import ready
from ..pairs.result import Estimates
from ..rig import Rig
from .decay import Decay, decay, each_of, machine

SUPPORT = 1.25  # length of phi in half-cycles
SHIFT = 1 / 8  # from one phi to the next, likewise
PHI = np.polynomial.Polynomial([1, 0, -1]) ** 4  # on [-1, 1]


class _Rows(NamedTuple):
    """One record: coefficients of (2 zeta omega, omega^2, F/m) and of omega^2 b, right-hand side, and operators."""

    shared: np.ndarray
    own: np.ndarray
    right: np.ndarray
    operators: tuple[Any, Any, Any]
    noise: np.ndarray
    centre: float


def weak_form(records: Any, rig: Rig) -> Estimates:
    """Natural frequency, damping ratio, coefficient of friction and equilibrium, all by linear equations.

    Good as a start for any fit: nothing has to be guessed.

    Args:
        records: a run, or a list of runs of one machine, each given as to :func:`fricjax.fit`.
        rig: mass and load, which turn the deceleration into a coefficient of friction.

    Returns:
        natural_frequency [Hz], damping_ratio [1], mu [1], and for each record an offset [m].

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit.
        DataError: records with too few half-cycles, or sampled unevenly.

    ```python
    fricjax.energy_loss.weak_form("run.csv", rig).values["mu"]
    ```
    """
    ready()
    oscillator = machine(rig, damping_known=False)
    found, notes = each_of(records, decay)
    rows = [_rows(each) for each in found]
    basis, right = _stacked(rows)
    inverse = np.linalg.pinv(basis)
    values = inverse @ right
    covariances = [_covariance(row, values) for row in rows]
    ends = np.cumsum([row.right.size for row in rows])[:-1]
    parts = zip(np.split(inverse, ends, axis=1), covariances, strict=True)
    covariance = sum(part @ each @ part.T for part, each in parts)
    left, expected = right - basis @ values, sum(float(np.trace(each)) for each in covariances)
    ratio = float(oscillator.mass) / float(oscillator.normal_force)
    slopes, named = _named(values, ratio, [row.centre for row in rows])
    offsets = ["offset"] if len(rows) == 1 else [f"offset[{i}]" for i in range(len(rows))]
    units = {"natural_frequency": "Hz", "damping_ratio": "", "mu": "", **dict.fromkeys(offsets, "m")}
    chi2 = float(left @ left) / expected * right.size / max(right.size - values.size, 1)
    return Estimates.of(units, named, slopes @ covariance @ slopes.T, chi2, notes)


def _rows(decay: Decay) -> _Rows:
    """The equations of one record: functions shifted along the motion from the first reversal to the end."""
    t, x = (np.concatenate([getattr(stroke, name) for stroke in decay.strokes]) for name in "tx")
    noise = np.concatenate([np.full(stroke.t.size, stroke.noise) for stroke in decay.strokes])
    half, centre = float(np.median(np.diff(decay.times))), float(np.mean(decay.points))
    width = SUPPORT * half / 2
    middles = np.arange(decay.times[0] + width, decay.times[-1] - width + 1e-9 * half, SHIFT * half)
    operators = _operators(t, middles, width)
    area, signed = _integrals(decay, middles, width)
    plain, slope, curvature = (operator @ (x - centre) for operator in operators)
    shared = np.column_stack([-slope, plain, signed])
    return _Rows(shared, -area[:, None], -curvature, operators, noise, centre)  # type: ignore[arg-type]


def _operators(t: np.ndarray, middles: np.ndarray, width: float) -> tuple[Any, Any, Any]:
    """Sparse matrices, shape (rows, n), that integrate the samples times phi and its first two derivatives."""
    from scipy.sparse import csr_array

    first, last = np.searchsorted(t, [middles - width, middles + width])
    columns = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    starts = np.concatenate([[0], np.cumsum(last - first)])
    u = (t[columns] - np.repeat(middles, last - first)) / width
    steps = np.gradient(t)[columns]
    shape = (middles.size, t.size)
    values = (steps * (PHI.deriv(k)(u) if k else PHI(u)) / width**k for k in range(3))
    return tuple(csr_array((each, columns, starts), shape) for each in values)  # type: ignore[return-value]


def _integrals(decay: Decay, middles: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of phi and of phi sgn(v), stroke by stroke, shape (rows,)."""
    ends = np.clip((decay.times - middles[:, None]) / width, -1, 1)
    pieces = width * np.diff(PHI.integ()(ends), axis=1)
    return pieces.sum(axis=1), pieces @ np.array([stroke.direction for stroke in decay.strokes])


def _stacked(rows: list[_Rows]) -> tuple[np.ndarray, np.ndarray]:
    """All equations: the shared coefficients, then one column of omega^2 b for each record."""
    record = np.repeat(np.arange(len(rows)), [row.right.size for row in rows])
    own = np.concatenate([row.own for row in rows]) * (record[:, None] == np.arange(len(rows)))
    return np.hstack([np.concatenate([row.shared for row in rows]), own]), np.concatenate([row.right for row in rows])


def _covariance(row: _Rows, values: np.ndarray) -> np.ndarray:
    """Covariance of the equations of one record by the noise of its samples, shape (rows, rows)."""
    from scipy.sparse import diags_array

    plain, slope, curvature = row.operators
    seen = (curvature - values[0] * slope + values[1] * plain) @ diags_array(row.noise)
    return (seen @ seen.T).toarray()


def _named(values: np.ndarray, ratio: float, centres: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """The coefficients one asks for, and their derivatives with respect to those of the equations."""
    viscous, square, friction, *pulls = values
    omega, size = np.sqrt(square), values.size
    slopes = np.zeros((size, size))
    slopes[0, 1] = 1 / (4 * np.pi * omega)
    slopes[1, :2] = 1 / (2 * omega), -viscous / (4 * omega**3)
    slopes[2, 2] = ratio
    slopes[3:, 1] = -np.array(pulls) / square**2
    slopes[3:, 3:] = np.eye(size - 3) / square
    offsets = np.array(pulls) / square + centres
    return slopes, np.array([omega / (2 * np.pi), viscous / (2 * omega), friction * ratio, *offsets])
