"""How a run of the solver ended, as small integers that arrays can hold, and what each of them means in words."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .covariance import WEAKEST
from .damped_step import Setting, units

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
    """Status once the loop has ended: a converged fit may still be at a bound or undetermined."""
    # A loop that is ended from outside, by optimistix's own limit of steps, leaves the status at RUNNING.
    cut_short = jnp.where(jnp.all(jnp.isfinite(y)), OUT_OF_STEPS, NOT_FINITE)
    status = jnp.where(status == RUNNING, cut_short, status)
    movable = setting.lower < setting.upper
    inside = (setting.lower < y) & (y < setting.upper)
    at_bound = jnp.any(movable & ~inside)
    converged = jnp.where(at_bound, AT_BOUND, CONVERGED)
    converged = jnp.where(is_determined(normal, inside), converged, UNDETERMINED)
    return jnp.where(status == CONVERGED, converged, status)


def is_determined(normal: Float[Array, "p p"], free: Bool[Array, " p"]) -> Bool[Array, ""]:
    """Whether every direction among the free parameters shows in the normal matrix."""
    unit, identity = units(normal), jnp.eye(free.size)
    # Rows that are fixed or not finite become those of the identity, whose eigenvalue of one hides none of the others.
    matrix = jnp.where(free[:, None] & free & jnp.isfinite(normal), normal / (unit[:, None] * unit), identity)
    return jnp.linalg.eigvalsh(matrix)[0] > WEAKEST
