"""Damped steps within bounds, and projection of linear coordinates.

All systems scale the normal matrix to a unit diagonal, so the units of parameters and residuals cancel. Small systems
are eliminated elementwise, in batches along the leading axis; a call into LAPACK would cost more than the arithmetic.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .arrays import fori_loop, namespace, while_loop
from .covariance import WEAKEST
from .passes import Pass

# Largest system eliminated here; for larger ones LAPACK is faster.
_LARGEST_SMALL = 32
# Relative cost after projection below which the difference has lost half of its digits.
_DIGITS_LOST = 1e-8
# Largest part of a Gauss-Newton step that damping may remove for the step to be tried undamped.
_TAKEN = 0.5

Systems = Float[Array, "k p"]


class Setting(NamedTuple):
    """Solver options as arrays.

    Attributes:
        lower, upper: bounds, shape (p,).
        dof: degrees of freedom.
        floor: sum of squares caused by rounding alone.
        linear: coordinates to project, shape (p,).
    """

    lower: Float[Array, " p"]
    upper: Float[Array, " p"]
    dof: Float[Array, ""]
    floor: Float[Array, ""]
    linear: Bool[Array, " p"]

    @classmethod
    def of(cls, options: dict[str, Any]) -> "Setting":
        lower, upper = options["lower"], options["upper"]
        xp = namespace(lower)
        linear = xp.asarray(options.get("linear", xp.zeros(lower.shape, bool)))
        unbounded = (lower == -xp.inf) & (upper == xp.inf)
        return cls(lower, upper, options["dof"], options["floor"], linear & unbounded)


def units(normal: Float[Array, "p p"]) -> Float[Array, " p"]:
    """Return the length of each Jacobian column, one for a zero column."""
    xp = namespace(normal)
    diagonal = xp.diagonal(normal)
    return xp.sqrt(xp.where(diagonal > 0, diagonal, 1.0))


def eliminate(matrix: Float[Array, "... n n"], right: Float[Array, "... n"]) -> Float[Array, "... n"]:
    """Solve systems by Gauss-Jordan elimination without pivoting, with one program per size."""
    xp, n = namespace(matrix), right.shape[-1]
    index = xp.arange(n)[:, None]

    def clear_column(k: Any, rows: Array) -> Array:
        row, column = rows[..., k, None, :], rows[..., k, None]
        row = row / row[..., k, None]
        return xp.where(index == k, row, rows - column * row)

    return fori_loop(xp, n, clear_column, xp.concatenate([matrix, right[..., None]], axis=-1))[..., n]


def restricted_solve(normal: Array, damping: Systems, free: Bool[Array, "k p"], right: Systems) -> Systems:
    """Solve damped normal equations for the free unknowns.

    The system is ``(S^-1 H S^-1 + diag(damping)) S x = S^-1 right``, with S the column lengths of H.

    Args:
        normal: H, shape (p, p).
        damping: added to the unit diagonal, shape (k, p); at least `WEAKEST`.
        free: unknowns of each system, shape (k, p).
        right: right-hand sides, shape (k, p).

    Returns:
        x, shape (k, p), zero for fixed unknowns.
    """
    xp, unit, p = namespace(normal), units(normal), normal.shape[0]
    identity = xp.identity(p)
    damped = normal / (unit[:, None] * unit) + damping[:, :, None] * identity
    matrix = xp.where(free[:, :, None] & free[:, None, :], damped, identity)
    target = xp.where(free, right / unit, 0.0)
    if p > _LARGEST_SMALL and xp is jnp:
        return jax.scipy.linalg.solve(matrix, target[:, :, None], assume_a="pos")[:, :, 0] / unit
    return eliminate(matrix, target) / unit


def bounded_steps(
    here: Pass, damping: Systems, lower: Float[Array, " p"], upper: Float[Array, " p"]
) -> Float[Array, "k p"]:
    """Minimise damped models within a box by an active set.

    A parameter at a bound stays there if the gradient presses it outward. The step goes straight to the minimum over
    the other parameters. If it meets a bound, that parameter is fixed there and the others continue. The model
    therefore decreases along the whole path.

    Args:
        here: cost, gradient and normal matrix at the present point.
        damping: added to the unit diagonal of the normal matrix, one row for each model, shape (k, p).
        lower: distance to the lower bounds, not positive, shape (p,).
        upper: distance to the upper bounds, not negative, shape (p,).

    Returns:
        Steps, shape (k, p); one that ends at a bound equals its distance exactly.
    """
    xp = namespace(here.normal)

    def advance(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        step, fixed, _ = state
        right = -here.gradient - xp.where(fixed, step, 0.0) @ here.normal
        target = xp.where(fixed, step, restricted_solve(here.normal, damping, ~fixed, right))
        beyond = ~fixed & ((target < lower) | (target > upper))
        bound = xp.where(target > upper, upper, lower)
        reach = xp.where(beyond, (bound - step) / xp.where(beyond, target - step, 1.0), 1.0)
        nearest = xp.min(reach, axis=1, keepdims=True)
        hit = beyond & (reach <= nearest)
        partway = xp.where(nearest < 1, step + nearest * (target - step), target)
        return xp.where(hit, bound, xp.clip(partway, lower, upper)), fixed | hit, xp.any(hit)

    fixed = pressed(here, lower, upper) | xp.zeros(damping.shape, bool)
    return while_loop(xp, lambda state: state[2], advance, (xp.zeros_like(damping), fixed, xp.asarray(True)))[0]


def pressed(here: Pass, lower: Float[Array, " p"], upper: Float[Array, " p"]) -> Bool[Array, " p"]:
    """Return the parameters pressed outward at a bound, or between equal bounds."""
    return ((lower >= 0) & (here.gradient > 0)) | ((upper <= 0) & (here.gradient < 0)) | (lower == upper)


def project(there: Pass, linear: Bool[Array, " p"]) -> tuple[Pass, Float[Array, " p"], Bool[Array, ""]]:
    """Move linear coordinates to their optimum (Golub and Pereyra, 1973).

    The quadratic model is exact in coordinates in which the residual is linear, as long as the other columns of the
    Jacobian do not depend on them. The pass at the moved point then follows in closed form, except for `kept`.

    Returns:
        The pass at the moved point; the move, shape (p,); and whether cancellation lost so many digits of the cost
        that the model must be evaluated again.
    """
    xp = namespace(there.normal)
    weakest = xp.full((1, linear.size), WEAKEST)
    move = restricted_solve(there.normal, weakest, linear[None], -there.gradient[None])[0]
    pull = there.normal @ move
    cost = xp.maximum(there.cost + move @ (there.gradient + pull / 2), 0.0)
    moved = there._replace(cost=cost, gradient=there.gradient + pull)
    return moved, move, cost < _DIGITS_LOST * there.cost


class Proposal(NamedTuple):
    """The damped and the Gauss-Newton step from a point, within the bounds.

    Attributes:
            trial: end point of the step to try.
            predicted: predicted reduction of the cost.
            full: the Gauss-Newton step.
            shortening: its square in the metric of the normal matrix: twice the cost reduction it predicts.
            undamped: whether the trial is the Gauss-Newton step.
    """

    trial: Float[Array, " p"]
    predicted: Float[Array, ""]
    full: Float[Array, " p"]
    shortening: Float[Array, ""]
    undamped: Bool[Array, ""]


def propose(y: Array, here: Pass, scale: Array, damping: Array, setting: Setting, trusted: Array) -> Proposal:
    """Compute the damped and the undamped step from `y`.

    The trial is the Gauss-Newton step if its shortening is below `trusted` and damping would remove less than half of
    it.

    Args:
        y: present point, shape (p,).
        here: pass at `y`.
        scale: largest diagonal of ``J'J`` so far, shape (p,).
        damping: damping strength.
        setting: solver options.
        trusted: shortening below which the quadratic model is trusted.
    """
    xp = namespace(here.normal)
    relative = xp.where(setting.linear, 0.0, damping * scale / units(here.normal) ** 2)
    lower, upper = setting.lower - y, setting.upper - y
    dampings = xp.maximum(xp.stack([relative, xp.zeros_like(y)]), WEAKEST)
    steps = bounded_steps(here, dampings, lower, upper)
    bends = xp.sum(steps * (steps @ here.normal), axis=1)
    full, shortening = steps[1], bends[1]
    # Only damping keeps a step short along a direction to which the residual is insensitive.
    size, shortened = xp.sum((units(here.normal) * xp.stack([full, full - steps[0]])) ** 2, axis=1)
    undamped = (shortening < trusted) & (shortened < _TAKEN**2 * size)
    step, bend = xp.where(undamped, full, steps[0]), xp.where(undamped, shortening, bends[0])
    # Set the bound exactly; adding the step to `y` would miss it by rounding.
    trial = xp.where(step <= lower, setting.lower, xp.where(step >= upper, setting.upper, y + step))
    return Proposal(trial, -(here.gradient @ step + bend / 2), full, shortening, undamped)
