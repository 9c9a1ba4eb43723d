"""One pass over the model, and what it leaves behind for the solver: the cost, its gradient and the normal matrix.

A pass may run over a record in pieces and add up theirs.
"""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from equinox import AbstractVar
from jaxtyping import Array, Bool, Float, PyTree

from .loss import AbstractLoss, Squares


class Pass(NamedTuple):
    """What one pass leaves behind: half the sum of losses, its gradient ``J'r`` and normal matrix ``J'J``.

    Under a loss other than squares, the gradient is ``J'Wr`` and the normal matrix ``J'CJ`` with the loss's weights
    and curvatures. What else of it is `kept`, a tree of arrays, the solver hands on.
    """

    cost: Float[Array, ""]
    gradient: Float[Array, " p"]
    normal: Float[Array, "p p"]
    kept: Any = None

    @property
    def finite(self) -> Bool[Array, ""]:
        """Whether all of it is finite; a tangent that is not finite shows in the normal matrix."""
        return jnp.isfinite(self.cost) & jnp.all(jnp.isfinite(self.gradient)) & jnp.all(jnp.isfinite(self.normal))


def residual_and_jacobian(fn: Callable, y: Float[Array, " p"]) -> tuple[Float[Array, " n"], Float[Array, "n p"]]:
    """Residual and its Jacobian in one pass of forward mode."""

    def twice(q: Array) -> tuple[Array, Array]:
        r = fn(q)
        return r, r

    jacobian, residual = jax.jacfwd(twice, has_aux=True)(y)
    return residual, jacobian


def gather(residual: Float[Array, " n"], jacobian: Float[Array, "n p"], loss: AbstractLoss) -> Pass:
    """Sums over residuals of one loss; those of several pieces add up to the pass."""
    rho, weight, curvature = loss.parts(residual)
    return Pass(jnp.sum(rho) / 2, jacobian.T @ (weight * residual), jacobian.T @ (curvature[:, None] * jacobian))


class AbstractPasses(eqx.Module):
    """How a pass over the model is made.

    Attributes:
        loss: loss of the residuals.
    """

    loss: AbstractVar[AbstractLoss]

    @abc.abstractmethod
    def __call__(self, fn: Callable, y: Float[Array, " p"], args: PyTree) -> Pass:
        """Run the model at `y`; ``fn(y, args)`` returns residuals of shape (n,) and something else."""

    def nothing(self, y: Float[Array, " p"]) -> Pass:
        """What stands before the first pass."""
        return Pass(jnp.asarray(jnp.inf), jnp.zeros(y.size), jnp.full((y.size, y.size), jnp.nan))


class DensePasses(AbstractPasses):
    """The full Jacobian at once, by forward mode.

    Attributes:
        loss: loss of the residuals.
    """

    loss: AbstractLoss = Squares()

    def __call__(self, fn: Callable, y: Float[Array, " p"], args: PyTree) -> Pass:
        residual, jacobian = residual_and_jacobian(lambda q: fn(q, args)[0], y)
        return gather(residual, jacobian, self.loss)
