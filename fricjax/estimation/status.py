"""Outcome of a Levenberg-Marquardt run.

This module is separate from the solver, because loading a compiled solver needs these names but not optimistix.
"""

from jaxtyping import Array, Bool, Float, Int

from .arrays import fori_loop, namespace
from .covariance import WEAKEST
from .damped_step import Setting, units

MAX_STEPS = 60
"""Default maximum number of passes."""

# Status codes as small integers that arrays can hold, and their descriptions.
RUNNING, CONVERGED, AT_BOUND, STALLED, NOT_FINITE, OUT_OF_STEPS, UNDETERMINED = range(7)

SENTENCES = {
    RUNNING: "The solver is still at work.",
    CONVERGED: "Converged: any further step would be lost in the scatter of the residuals.",
    AT_BOUND: "Converged with a parameter at its bound: the bound and not the data decides its value.",
    STALLED: "Stalled: no step makes the fit better although the gradient asks for one.",
    NOT_FINITE: "Not finite: the model fails at the start values.",
    OUT_OF_STEPS: "Out of steps: the optimum was not reached.",
    UNDETERMINED: "Converged, but a direction among the parameters has no effect on the residuals.",
}


def final_status(
    status: Int[Array, ""], y: Float[Array, " p"], normal: Float[Array, "p p"], setting: Setting
) -> Int[Array, ""]:
    """Return the status after the loop.

    A converged fit may still be at a bound or undetermined.
    """
    xp = namespace(y)
    # optimistix ends the loop at its own limit of steps and leaves the status at RUNNING.
    cut_short = xp.where(xp.all(xp.isfinite(y)), OUT_OF_STEPS, NOT_FINITE)
    status = xp.where(status == RUNNING, cut_short, status)
    movable = setting.lower < setting.upper
    inside = (setting.lower < y) & (y < setting.upper)
    at_bound = xp.any(movable & ~inside)
    converged = xp.where(at_bound, AT_BOUND, CONVERGED)
    converged = xp.where(is_determined(normal, inside), converged, UNDETERMINED)
    return xp.where(status == CONVERGED, converged, status)


def is_determined(normal: Float[Array, "p p"], free: Bool[Array, " p"]) -> Bool[Array, ""]:
    """Return True if the normal matrix determines every free direction.

    The result does not depend on the units of the parameters.

    Examples:
        >>> import numpy as np
        >>> free = np.ones(2, bool)
        >>> bool(is_determined(np.diag([2.0, 1e-9]), free)), bool(is_determined(np.ones((2, 2)), free))
        (True, False)
    """
    xp = namespace(normal)
    unit, identity = units(normal), xp.identity(free.size)
    # Replace rows that are fixed or not finite by rows of the identity; their eigenvalue of one hides no other.
    matrix = xp.where(free[:, None] & free & xp.isfinite(normal), normal / (unit[:, None] * unit), identity)
    below = xp.arange(free.size)[:, None]

    def clear_below(k: Array, rows: Array) -> Array:
        return xp.where(below > k, rows - rows[:, k, None] * rows[k] / rows[k, k], rows)

    # By Sylvester's law of inertia, positive pivots mean that no eigenvalue is below the threshold. LAPACK would return
    # the eigenvalues, but compiling its call costs a first fit more time than all its steps.
    pivots = xp.diagonal(fori_loop(xp, free.size, clear_below, matrix - WEAKEST * identity))
    return xp.all(pivots > 0)
