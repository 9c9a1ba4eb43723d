"""What a residual costs: its square, or less than that where it is far larger than the noise.

With ``z = r^2`` a loss ``rho(z)`` makes ``sum rho(r_i^2) / 2`` small. Its gradient weighs each residual by ``rho'(z)``,
and the curvature along a residual is ``rho'(z) + 2 z rho''(z)`` (Triggs et al., Bundle Adjustment, 2000, 4.3). That
curvature vanishes or turns negative for outliers; it is kept at a tenth of the weight, so that a fit in which all
residuals look like outliers at the start still has a positive normal matrix.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..errors import check_choice
from ..settings import LOSSES

# Part of its weight that the curvature along a residual keeps at least, see above.
_LEAST_CURVATURE = 0.1

Residuals = Float[Array, " n"]


class AbstractLoss(eqx.Module):
    """Loss of residuals that are in units of their standard deviation."""

    @abc.abstractmethod
    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        """Loss ``rho``, weight ``rho'`` and curvature ``rho' + 2 z rho''`` of each residual, at ``z = r^2``."""


class Squares(AbstractLoss):
    """Least squares: every residual counts with its square."""

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        one = jnp.ones_like(residual)
        return residual**2, one, one


class Huber(AbstractLoss):
    """Square up to `delta`, straight beyond (Huber, 1964).

    Attributes:
        delta: where a residual begins to be an outlier, in standard deviations.
    """

    delta: float = 1.345

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        size = jnp.abs(residual)
        inside = size <= self.delta
        weight = self.delta / jnp.where(inside, self.delta, size)
        loss = jnp.where(inside, residual**2, self.delta * (2 * size - self.delta))
        return loss, weight, jnp.where(inside, 1.0, _LEAST_CURVATURE * weight)


class SoftL1(AbstractLoss):
    """Smooth transition from the square to a straight line, ``2 delta^2 (sqrt(1 + z/delta^2) - 1)``.

    Attributes:
        delta: where a residual begins to be an outlier, in standard deviations.
    """

    delta: float = 1.0

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        root = jnp.sqrt(1 + (residual / self.delta) ** 2)
        weight = 1 / root
        # z / (root + 1) is delta^2 (root - 1) without its cancellation.
        return 2 * residual**2 / (root + 1), weight, jnp.maximum(weight**3, _LEAST_CURVATURE * weight)


class Cauchy(AbstractLoss):
    """Logarithm, ``delta^2 ln(1 + z/delta^2)``: outliers lose all influence; start near the optimum.

    Attributes:
        delta: where a residual begins to be an outlier, in standard deviations.
    """

    delta: float = 2.385

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        z = (residual / self.delta) ** 2
        weight = 1 / (1 + z)
        return self.delta**2 * jnp.log1p(z), weight, weight * jnp.maximum((1 - z) * weight, _LEAST_CURVATURE)


_NAMED = dict(zip(LOSSES, (Squares, Huber, SoftL1, Cauchy), strict=True))


def named_loss(loss: str | AbstractLoss) -> AbstractLoss:
    """The loss of that name with its usual constant; a loss is returned as it is.

    Raises:
        UsageError: no such loss.
    """
    if isinstance(loss, AbstractLoss):
        return loss
    check_choice("loss", loss, LOSSES)
    return _NAMED[loss]()
