"""Steps on the quadratic model of a pass: damped, within bounds, and free of the coordinates that need no step.

All systems have the normal matrix scaled to a unit diagonal, so that units of parameters and residuals drop out.
Small ones are eliminated in elementwise operations, without a call into LAPACK, which would cost more than the
arithmetic, several of them side by side along the leading axis.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .covariance import WEAKEST
from .passes import Pass

# Largest system that is eliminated here; beyond it a call into LAPACK costs less than the arithmetic.
_LARGEST_SMALL = 32
# Part of the cost below which what a projection leaves of it has lost half of its digits.
_DIGITS_LOST = 1e-8
# Part of a Gauss-Newton step that damping may take for the step to be tried undamped.
_TAKEN = 0.5

Systems = Float[Array, "k p"]


class Setting(NamedTuple):
    """The solver's options as arrays: bounds, degrees of freedom, sum of squares by rounding, projected coordinates."""

    lower: Float[Array, " p"]
    upper: Float[Array, " p"]
    dof: Float[Array, ""]
    floor: Float[Array, ""]
    linear: Bool[Array, " p"]

    @classmethod
    def of(cls, options: dict[str, Any]) -> "Setting":
        lower, upper = options["lower"], options["upper"]
        linear = jnp.asarray(options.get("linear", jnp.zeros(lower.shape, bool)))
        unbounded = (lower == -jnp.inf) & (upper == jnp.inf)
        return cls(lower, upper, options["dof"], options["floor"], linear & unbounded)


def units(normal: Float[Array, "p p"]) -> Float[Array, " p"]:
    """Length of each column of the Jacobian, one for a column of zeros."""
    diagonal = jnp.diagonal(normal)
    return jnp.sqrt(jnp.where(diagonal > 0, diagonal, 1.0))


def eliminate(matrix: Float[Array, "... n n"], right: Float[Array, "... n"]) -> Float[Array, "... n"]:
    """Solutions of systems, by Gauss-Jordan elimination without pivoting, compiled once for any size."""
    n = right.shape[-1]
    index = jnp.arange(n)[:, None]

    def clear_column(k: Array, rows: Array) -> Array:
        row, column = (jax.lax.dynamic_slice_in_dim(rows, k, 1, axis=axis) for axis in (-2, -1))
        row = row / jax.lax.dynamic_slice_in_dim(row, k, 1, axis=-1)
        return jnp.where(index == k, row, rows - column * row)

    return jax.lax.fori_loop(0, n, clear_column, jnp.concatenate([matrix, right[..., None]], axis=-1))[..., n]


def restricted_solve(normal: Array, damping: Systems, free: Bool[Array, "k p"], right: Systems) -> Systems:
    """Solve ``(S^-1 H S^-1 + diag(damping)) S x = S^-1 right`` among the free unknowns, with the units S of H.

    Args:
        normal: H, shape (p, p).
        damping: added to the unit diagonal, shape (k, p); at least `WEAKEST`.
        free: unknowns of each system, shape (k, p).
        right: right-hand sides, shape (k, p).

    Returns:
        x, shape (k, p), zero where it is not free.
    """
    unit, p = units(normal), normal.shape[0]
    identity = jnp.eye(p)
    damped = normal / (unit[:, None] * unit) + damping[:, :, None] * identity
    matrix = jnp.where(free[:, :, None] & free[:, None, :], damped, identity)
    target = jnp.where(free, right / unit, 0.0)
    if p > _LARGEST_SMALL:
        return jax.scipy.linalg.solve(matrix, target[:, :, None], assume_a="pos")[:, :, 0] / unit
    return eliminate(matrix, target) / unit


def bounded_steps(
    here: Pass, damping: Systems, lower: Float[Array, " p"], upper: Float[Array, " p"]
) -> Float[Array, "k p"]:
    """Low points of damped models within a box, by an active set.

    A parameter at its bound that the gradient presses outward stays there. The step goes straight to the lowest
    point of the others; where it meets a bound, that parameter stays at it and the others continue from there. So the
    model only falls along the way.

    Args:
        here: cost, gradient and normal matrix at the present point.
        damping: added to the unit diagonal of the normal matrix, one row for each model, shape (k, p).
        lower: distance to the lower bounds, not positive, shape (p,).
        upper: distance to the upper bounds, not negative, shape (p,).

    Returns:
        Steps, shape (k, p); one that ends at a bound equals its distance exactly.
    """

    def advance(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        step, fixed, _ = state
        right = -here.gradient - jnp.where(fixed, step, 0.0) @ here.normal
        target = jnp.where(fixed, step, restricted_solve(here.normal, damping, ~fixed, right))
        beyond = ~fixed & ((target < lower) | (target > upper))
        bound = jnp.where(target > upper, upper, lower)
        reach = jnp.where(beyond, (bound - step) / jnp.where(beyond, target - step, 1.0), 1.0)
        nearest = jnp.min(reach, axis=1, keepdims=True)
        hit = beyond & (reach <= nearest)
        partway = jnp.where(nearest < 1, step + nearest * (target - step), target)
        return jnp.where(hit, bound, jnp.clip(partway, lower, upper)), fixed | hit, jnp.any(hit)

    fixed = pressed(here, lower, upper) | jnp.zeros(damping.shape, bool)
    return jax.lax.while_loop(lambda state: state[2], advance, (jnp.zeros_like(damping), fixed, jnp.asarray(True)))[0]


def pressed(here: Pass, lower: Float[Array, " p"], upper: Float[Array, " p"]) -> Bool[Array, " p"]:
    """Parameters that cannot move: at a bound with the gradient pressing outward, or between equal bounds."""
    return ((lower >= 0) & (here.gradient > 0)) | ((upper <= 0) & (here.gradient < 0)) | (lower == upper)


def project(there: Pass, linear: Bool[Array, " p"]) -> tuple[Pass, Float[Array, " p"], Bool[Array, ""]]:
    """Move the coordinates in which the residual is linear to their optimum (Golub and Pereyra, 1973).

    In them the pass is the exact quadratic model as long as the other columns of the Jacobian do not depend on them,
    so the pass at the moved point follows in closed form, all but what else it has kept.

    Returns:
        The pass at the moved point; the move, shape (p,); and whether the cost fell so far that its difference has
        lost digits which only another pass brings back.
    """
    weakest = jnp.full((1, linear.size), WEAKEST)
    move = restricted_solve(there.normal, weakest, linear[None], -there.gradient[None])[0]
    pull = there.normal @ move
    cost = jnp.maximum(there.cost + move @ (there.gradient + pull / 2), 0.0)
    moved = there._replace(cost=cost, gradient=there.gradient + pull)
    return moved, move, cost < _DIGITS_LOST * there.cost


class Proposal(NamedTuple):
    """The damped and the Gauss-Newton step from a point, within the bounds.

    Attributes:
        trial: where the step ends that is to be tried.
        predicted: by how much it should lower the cost.
        full: the Gauss-Newton step.
        shortening: its square in the metric of the normal matrix: twice what it should lower the cost by.
        undamped: whether the trial is the Gauss-Newton step.
    """

    trial: Float[Array, " p"]
    predicted: Float[Array, ""]
    full: Float[Array, " p"]
    shortening: Float[Array, ""]
    undamped: Bool[Array, ""]


def propose(y: Array, here: Pass, scale: Array, damping: Array, setting: Setting, trusted: Array) -> Proposal:
    """Solve for both steps from `y`, whose pass is `here`; `scale` is the largest diagonal of ``J'J`` met so far.

    The trial is the Gauss-Newton step where its shortening is below that which is `trusted`, and damping leaves most of
    it.
    """
    relative = jnp.where(setting.linear, 0.0, damping * scale / units(here.normal) ** 2)
    lower, upper = setting.lower - y, setting.upper - y
    dampings = jnp.maximum(jnp.stack([relative, jnp.zeros_like(y)]), WEAKEST)
    steps = bounded_steps(here, dampings, lower, upper)
    bends = jnp.sum(steps * (steps @ here.normal), axis=1)
    full, shortening = steps[1], bends[1]
    # Along a direction that the residual hardly tells damping is what keeps a step short.
    size, shortened = jnp.sum((units(here.normal) * jnp.stack([full, full - steps[0]])) ** 2, axis=1)
    undamped = (shortening < trusted) & (shortened < _TAKEN**2 * size)
    step, bend = jnp.where(undamped, full, steps[0]), jnp.where(undamped, shortening, bends[0])
    # A step that ends at a bound ends there exactly, which adding it to `y` would miss by rounding.
    trial = jnp.where(step <= lower, setting.lower, jnp.where(step >= upper, setting.upper, y + step))
    return Proposal(trial, -(here.gradient @ step + bend / 2), full, shortening, undamped)
