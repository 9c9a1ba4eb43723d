"""The weak form of the equation of motion: linear, without derivatives.

Multiply the equation of motion for Coulomb and viscous friction on a linear spring by a smooth function phi that
vanishes with its slope at both ends, and integrate by parts:

    int phi'' x - 2 zeta omega int phi' x + omega^2 int phi x - omega^2 b int phi + (F/m) int phi sgn(v) = 0.

The last integrand jumps at the reversals, so the integral is split there; each part has a closed form. The method is
that of modulating functions (Shinbrot 1957).
"""

from typing import Any, NamedTuple

import numpy as np

from ..oscillator import ready
from ..pairs.result import Estimates
from ..rig import Rig
from .decay import Decay, decay, each_of, frictionless

# Length of phi in half-cycles. Each phi must contain a reversal; otherwise friction equals a shift of the equilibrium.
SUPPORT = 1.25
# Distance between neighbouring phi in half-cycles. They overlap, and the covariance of the equations accounts for it.
SHIFT = 1 / 8
# On [-1, 1]. With the fourth power phi'' vanishes at the ends too, so that plain sums of samples are good integrals.
PHI = np.polynomial.Polynomial([1, 0, -1]) ** 4


class _Equations(NamedTuple):
    """The equations of one record.

    `shared` are the coefficients of (2 zeta omega, omega^2, F/m), `of_offset` those of omega^2 b.
    """

    shared: np.ndarray
    of_offset: np.ndarray
    right: np.ndarray
    operators: tuple[Any, Any, Any]
    noise: np.ndarray
    centre: float


def weak_form(records: Any, rig: Rig) -> Estimates:
    """Estimate frequency, damping ratio, mu and equilibrium by linear equations.

    The estimates need no start values, and are good start values for any fit.

    Args:
        records: a run, or a list of runs of one machine, each as for :func:`fricjax.fit`.
        rig: mass and load, which convert the deceleration into a coefficient of friction.

    Returns:
        natural_frequency [Hz], damping_ratio [1], mu [1], and for each record an offset [m].

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit.
        DataError: records with too few half-cycles, or sampled unevenly.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> estimates = fj.energy_loss.weak_form(files.run, fj.Rig.from_toml(files.rig))
        >>> round(estimates.values["natural_frequency"], 2), round(estimates.values["mu"], 4)
        (12.6, 0.02)
    """
    from scipy.sparse import diags_array

    ready()
    oscillator = frictionless(rig, damping_known=False)
    decays, notes = each_of(records, decay)
    records = [_equations(each) for each in decays]
    record = np.repeat(np.arange(len(records)), [each.right.size for each in records])
    # The shared coefficients, then one column of omega^2 b for each record.
    columns = np.concatenate([each.of_offset for each in records]) * (record[:, None] == np.arange(len(records)))
    basis = np.hstack([np.concatenate([each.shared for each in records]), columns])
    right = np.concatenate([each.right for each in records])
    inverse = np.linalg.pinv(basis)
    values = inverse @ right
    covariances = []
    for each in records:
        # Covariance of the equations of one record from the noise of its samples.
        plain, slope, curvature = each.operators
        response = (curvature - values[0] * slope + values[1] * plain) @ diags_array(each.noise)
        covariances.append((response @ response.T).toarray())
    parts = zip((inverse[:, record == i] for i in range(len(records))), covariances, strict=True)
    covariance = sum(part @ each @ part.T for part, each in parts)
    residual, expected = right - basis @ values, sum(float(np.trace(each)) for each in covariances)
    chi2 = float(residual @ residual) / expected * right.size / max(right.size - values.size, 1)
    # The final coefficients, and their derivatives with respect to those of the equations.
    viscous, square, friction, *pulls = values
    omega, ratio, size = np.sqrt(square), float(oscillator.mass) / float(oscillator.normal_force), values.size
    slopes = np.zeros((size, size))
    slopes[0, 1] = 1 / (4 * np.pi * omega)
    slopes[1, :2] = 1 / (2 * omega), -viscous / (4 * omega**3)
    slopes[2, 2] = ratio
    slopes[3:, 1] = -np.array(pulls) / square**2
    slopes[3:, 3:] = np.eye(size - 3) / square
    offsets = np.array(pulls) / square + [each.centre for each in records]
    estimates = np.array([omega / (2 * np.pi), viscous / (2 * omega), friction * ratio, *offsets])
    names = ["offset"] if len(records) == 1 else [f"offset[{i}]" for i in range(len(records))]
    units = {"natural_frequency": "Hz", "damping_ratio": "", "mu": "", **dict.fromkeys(names, "m")}
    return Estimates.of(units, estimates, slopes @ covariance @ slopes.T, chi2, notes)


def _equations(decay: Decay) -> _Equations:
    """Set up the equations of one record, with shifted phi."""
    t, x = (np.concatenate([getattr(each, name) for each in decay.half_cycles]) for name in "tx")
    noise = np.concatenate([np.full(each.t.size, each.noise) for each in decay.half_cycles])
    half, centre = float(np.median(np.diff(decay.times))), float(np.mean(decay.points))
    width = SUPPORT * half / 2
    middles = np.arange(decay.times[0] + width, decay.times[-1] - width + 1e-9 * half, SHIFT * half)
    operators = _operators(t, middles, width)
    # Integrals of phi and of phi sgn(v), half-cycle by half-cycle.
    ends = np.clip((decay.times - middles[:, None]) / width, -1, 1)
    pieces = width * np.diff(PHI.integ()(ends), axis=1)
    signed = pieces @ np.array([each.direction for each in decay.half_cycles])
    plain, slope, curvature = (operator @ (x - centre) for operator in operators)
    shared = np.column_stack([-slope, plain, signed])
    return _Equations(shared, -pieces.sum(axis=1)[:, None], -curvature, operators, noise, centre)


def _operators(t: np.ndarray, middles: np.ndarray, width: float) -> tuple[Any, Any, Any]:
    """Return sparse integrals of the samples times phi and its derivatives.

    The matrices have shape (rows, n), for phi and its first two derivatives.
    """
    from scipy.sparse import csr_array

    first, last = np.searchsorted(t, [middles - width, middles + width])
    columns = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    starts = np.concatenate([[0], np.cumsum(last - first)])
    u = (t[columns] - np.repeat(middles, last - first)) / width
    steps = np.gradient(t)[columns]
    shape = (middles.size, t.size)
    values = (steps * (PHI.deriv(k)(u) if k else PHI(u)) / width**k for k in range(3))
    return tuple(csr_array((each, columns, starts), shape) for each in values)  # type: ignore[return-value]
