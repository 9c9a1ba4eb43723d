"""Set-valued laws whose force falls from its static to its dynamic value as sliding begins."""

import abc

from equinox import AbstractVar

from .base import AbstractSetValued, Scalar, Values
from .coefficient import check_order


class AbstractFalling(AbstractSetValued):
    """``F = N [mu + (mu_s - mu) s(|v|)] sgn(v)``; its final classes say how ``s`` falls from one to zero."""

    mu: AbstractVar[Scalar]
    mu_s: AbstractVar[Scalar | None]
    v_stribeck: AbstractVar[Scalar]

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    @abc.abstractmethod
    def remaining(self, speed: Values) -> Values:
        """Share of the difference between static and dynamic friction that is left at `speed` >= 0 [m/s]."""

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        static = self.mu if self.mu_s is None else self.mu_s
        return load * (self.mu + (static - self.mu) * self.remaining(speed))

    def static_force(self, load: Scalar) -> Scalar:
        return (self.mu if self.mu_s is None else self.mu_s) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return self.v_stribeck
