"""A few residuals, a few parameters: Levenberg-Marquardt, and what its answer is worth."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array

from ..estimation.covariance import quadratic
from ..estimation.levenberg_marquardt import LevenbergMarquardt
from ..estimation.passes import residual_and_jacobian
from ..estimation.status import CONVERGED, NOT_FINITE, UNDETERMINED
from .scatter import Scale, scale_of


class Solution(NamedTuple):
    """Where the fit ended.

    Attributes:
        q: coordinates, shape (p,); `covariance`: of the coordinates, shape (p, p), inf where undetermined.
        undetermined: coordinates that the data leave open, shape (p,).
        chi2, dof: sum of squared weighted residuals and degrees of freedom, at least one.
        scale: by which the covariance is enlarged, and what that makes of intervals.
        status: what the solver said; `warnings`: in sentences.
    """

    q: np.ndarray
    covariance: np.ndarray
    undetermined: np.ndarray
    chi2: float
    dof: int
    scale: Scale
    status: int
    warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether the optimum was reached and every parameter is determined."""
        return self.status == CONVERGED and not self.undetermined.any()


def minimise(residual: Callable, parameters: int, *, scaled: bool, floor: float) -> Solution:
    """Least squares of weighted residuals from the origin.

    Args:
        residual: a module, so that another one with arrays of the same shapes needs no new compilation; it maps
            coordinates of shape (p,) to residuals of shape (n,).
        parameters: number of coordinates.
        scaled: whether the scale of the residuals is taken from their scatter, which is never below rounding.
        floor: sum of squares that rounding alone would leave.
    """
    found = _least_squares(residual, jnp.zeros(parameters), np.asarray(floor))
    q, r, jacobian, status = (np.asarray(value) for value in found)
    spare, chi2 = r.size - parameters, max(float(r @ r), floor if scaled else 0.0)
    shape = quadratic(jacobian.T @ r, jacobian.T @ jacobian, np.zeros(parameters, bool))
    scale = scale_of(chi2, spare, known=not scaled)
    unknown = shape.undetermined | (not np.isfinite(scale.factor))
    covariance = (scale.factor if np.isfinite(scale.factor) else 1.0) ** 2 * shape.inverse
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    covariance[unknown, unknown] = np.inf
    said = () if spare or not scaled else ("As many parameters as pairs: the scatter cannot tell any uncertainty.",)
    return Solution(q, covariance, shape.undetermined, chi2, max(spare, 1), scale, int(status), said)


@eqx.filter_jit
def _least_squares(residual: Callable, start: Array, floor: Any) -> tuple[Array, Array, Array, Array]:
    """Coordinates, residuals and Jacobian at the optimum, and the status of the solver."""
    wide, dof = jnp.full(start.shape, jnp.inf), max(jax.eval_shape(residual, start).size - start.size, 1)
    options = {"lower": -wide, "upper": wide, "dof": jnp.asarray(float(dof)), "floor": floor}
    solver = LevenbergMarquardt()
    found = optx.least_squares(lambda q, _: residual(q), solver, start, options=options, throw=False)
    r, jacobian = residual_and_jacobian(residual, found.value)
    return found.value, r, jacobian, found.stats["status"]


def status_of(names: Sequence[str], solution: Solution) -> str:
    """The outcome in words."""
    if solution.status == NOT_FINITE:
        return "not finite: the model fails at the start values. Check the coefficients of the oscillator."
    if solution.undetermined.any() or solution.status == UNDETERMINED:
        lost = ", ".join(name for name, bad in zip(names, solution.undetermined, strict=True) if bad) or "a combination"
        return f"undetermined: the pairs do not determine {lost}. Fix one parameter, or add pairs of other amplitudes."
    if solution.status != CONVERGED:
        return "stalled: the optimum was not reached. Check the numbers of half-cycles."
    return "converged"


def flags_of(names: Sequence[str], solution: Solution) -> dict[str, tuple[str, ...]]:
    """Remarks on each parameter."""
    return {name: ("undetermined",) if bad else () for name, bad in zip(names, solution.undetermined, strict=True)}
