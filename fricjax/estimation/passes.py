"""Evaluation of the least-squares problem: cost, gradient and normal matrix.

A pass may split a record into chunks and add their contributions.
"""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
from equinox import AbstractVar
from jaxtyping import Array, Bool, Float, PyTree

from .arrays import namespace
from .loss import AbstractLoss, Squares


class Pass(NamedTuple):
    """Cost, gradient ``J'r`` and normal matrix ``J'J`` at one point.

    The cost is half the sum of losses. Under a loss other than squares, the gradient is ``J'Wr`` and the normal matrix
    ``J'CJ`` with the loss's weights and curvatures. `kept` is a tree of arrays that the solver passes through.
    """

    cost: Float[Array, ""]
    gradient: Float[Array, " p"]
    normal: Float[Array, "p p"]
    kept: Any = None

    @property
    def finite(self) -> Bool[Array, ""]:
        """True if cost, gradient and normal matrix are finite.

        A tangent that is not finite shows in the normal matrix.
        """
        xp = namespace(self.cost)
        return xp.isfinite(self.cost) & xp.all(xp.isfinite(self.gradient)) & xp.all(xp.isfinite(self.normal))


def residual_and_jacobian(fn: Callable, y: Float[Array, " p"]) -> tuple[Float[Array, " n"], Float[Array, "n p"]]:
    """Compute the residual and its Jacobian in one forward-mode pass."""

    def twice(q: Array) -> tuple[Array, Array]:
        r = fn(q)
        return r, r

    jacobian, residual = jax.jacfwd(twice, has_aux=True)(y)
    return residual, jacobian


def gather(residual: Float[Array, " n"], jacobian: Float[Array, "n p"], loss: AbstractLoss) -> Pass:
    """Sum cost, gradient and normal matrix over residuals; chunks are additive."""
    rho, weight, curvature = loss.parts(residual)
    return Pass(
        namespace(residual).sum(rho) / 2, jacobian.T @ (weight * residual), jacobian.T @ (curvature[:, None] * jacobian)
    )


class AbstractPasses(eqx.Module):
    """Evaluation of cost, gradient and normal matrix.

    Attributes:
        loss: loss of the residuals.
    """

    loss: AbstractVar[AbstractLoss]

    @abc.abstractmethod
    def __call__(self, fn: Callable, y: Float[Array, " p"], args: PyTree) -> Pass:
        """Evaluate the model at `y`.

        ``fn(y, args)`` returns residuals of shape (n,) and auxiliary output.
        """

    def nothing(self, y: Float[Array, " p"]) -> Pass:
        """Return the placeholder before the first evaluation: infinite cost."""
        xp = namespace(y)
        return Pass(xp.asarray(xp.inf), xp.zeros(y.size), xp.full((y.size, y.size), xp.nan))


class DensePasses(AbstractPasses):
    """Dense Jacobian by forward mode.

    Attributes:
        loss: loss of the residuals.
    """

    loss: AbstractLoss = Squares()

    def __call__(self, fn: Callable, y: Float[Array, " p"], args: PyTree) -> Pass:
        residual, jacobian = residual_and_jacobian(lambda q: fn(q, args)[0], y)
        return gather(residual, jacobian, self.loss)
