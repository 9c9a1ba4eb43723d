"""What a fit that has ended must still admit: that a bound decides, or that a direction is undetermined."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .damped_step import WEAKEST, Setting, units
from .status import AT_BOUND, CONVERGED, NOT_FINITE, OUT_OF_STEPS, RUNNING, UNDETERMINED


def admitted_status(
    status: Int[Array, ""], y: Float[Array, " p"], normal: Float[Array, "p p"], setting: Setting
) -> Int[Array, ""]:
    """Final status: what ended the loop from outside, and what a converged fit must still admit."""
    cut_short = jnp.where(jnp.all(jnp.isfinite(y)), OUT_OF_STEPS, NOT_FINITE)
    status = jnp.where(status == RUNNING, cut_short, status)
    movable = setting.lower < setting.upper
    inside = (setting.lower < y) & (y < setting.upper)
    bound = jnp.any(movable & ~inside)
    admitted = jnp.where(bound, AT_BOUND, CONVERGED)
    admitted = jnp.where(determined(normal, inside), admitted, UNDETERMINED)
    return jnp.where(status == CONVERGED, admitted, status)


def determined(normal: Float[Array, "p p"], free: Bool[Array, " p"]) -> Bool[Array, ""]:
    """Whether every direction among the free parameters shows in the normal matrix."""
    unit, identity = units(normal), jnp.eye(free.size)
    matrix = jnp.where(free[:, None] & free & jnp.isfinite(normal), normal / (unit[:, None] * unit), identity)
    return jnp.linalg.eigvalsh(matrix)[0] > WEAKEST
