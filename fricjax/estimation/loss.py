"""Robust losses: quadratic for small residuals, slower growth for outliers.

The fit minimises ``sum rho(r_i^2) / 2`` with ``z = r^2``. The gradient weights each residual by ``rho'(z)``. The
curvature along a residual is ``rho'(z) + 2 z rho''(z)`` (Triggs et al., Bundle Adjustment, 2000, 4.3). For outliers it
vanishes or turns negative. It is kept at a tenth of the weight, so the normal matrix stays positive even if all
residuals look like outliers at the start.
"""

import abc

import equinox as eqx
from jaxtyping import Array, Float

from ..errors import check_choice
from ..settings import LOSSES
from .arrays import namespace

# Least curvature along a residual as a part of its weight, see above.
_LEAST_CURVATURE = 0.1

Residuals = Float[Array, " n"]


class AbstractLoss(eqx.Module):
    """Loss of residuals in units of their standard deviation."""

    @abc.abstractmethod
    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        """Return loss, weight and curvature of each residual.

        These are ``rho``, ``rho'`` and ``rho' + 2 z rho''`` at ``z = r^2``.
        """


class Squares(AbstractLoss):
    """Least squares: each residual contributes its square."""

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        xp = namespace(residual)
        one = xp.ones_like(residual)
        return residual**2, one, one


class Huber(AbstractLoss):
    """Quadratic up to `delta`, linear beyond (Huber, 1964).

    Attributes:
        delta: threshold for outliers, in standard deviations.
    """

    delta: float = 1.345

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        xp = namespace(residual)
        size = xp.abs(residual)
        inside = size <= self.delta
        weight = self.delta / xp.where(inside, self.delta, size)
        loss = xp.where(inside, residual**2, self.delta * (2 * size - self.delta))
        return loss, weight, xp.where(inside, 1.0, _LEAST_CURVATURE * weight)


class SoftL1(AbstractLoss):
    """Smooth transition from quadratic to linear.

    The loss is ``2 delta^2 (sqrt(1 + z/delta^2) - 1)``.

    Attributes:
        delta: threshold for outliers, in standard deviations.
    """

    delta: float = 1.0

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        xp = namespace(residual)
        root = xp.sqrt(1 + (residual / self.delta) ** 2)
        weight = 1 / root
        # z / (root + 1) equals delta^2 (root - 1) without cancellation.
        return 2 * residual**2 / (root + 1), weight, xp.maximum(weight**3, _LEAST_CURVATURE * weight)


class Cauchy(AbstractLoss):
    """Logarithmic loss ``delta^2 ln(1 + z/delta^2)``.

    Distant outliers have no influence. Start near the optimum.

    Attributes:
        delta: threshold for outliers, in standard deviations.
    """

    delta: float = 2.385

    def parts(self, residual: Residuals) -> tuple[Residuals, Residuals, Residuals]:
        xp = namespace(residual)
        z = (residual / self.delta) ** 2
        weight = 1 / (1 + z)
        return self.delta**2 * xp.log1p(z), weight, weight * xp.maximum((1 - z) * weight, _LEAST_CURVATURE)


_NAMED = dict(zip(LOSSES, (Squares, Huber, SoftL1, Cauchy), strict=True))


def named_loss(loss: str | AbstractLoss) -> AbstractLoss:
    """Return the loss of that name with its usual constant.

    An instance of `AbstractLoss` is returned unchanged.

    Raises:
        UsageError: unknown name.
    """
    if isinstance(loss, AbstractLoss):
        return loss
    check_choice("loss", loss, LOSSES)
    return _NAMED[loss]()
