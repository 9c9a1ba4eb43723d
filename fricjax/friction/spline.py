"""Friction forces that follow no formula: a smooth curve through free values at chosen speeds.

A cubic between neighbouring speeds, in the stretched speed ``s = ln(1 + v/v_1)`` with the first speed ``v_1`` above
zero as its unit, in which a force that changes over decades of speed changes evenly. Beyond the last speed the force is
constant.
"""

import abc
import functools
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from equinox import AbstractVar
from jaxtyping import Array

from .base import AbstractFriction, Scalar, Values, scalars
from .coefficient import Coefficient, not_negative
from .kinds import AbstractSetValued


def _speeds(knots: Iterable[Any]) -> tuple[float, ...]:
    return tuple(float(knot) for knot in knots)


class AbstractSpline(AbstractSetValued):
    """A cubic through free values, whose slopes there distinguish one spline from another.

    Attributes:
        knots: speeds [m/s], increasing from zero.
        forces: friction force over load at each of them [1]; at zero that with which sliding begins.

    Raises:
        ValueError: speeds that do not increase from zero, or not one force for each.
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "forces": not_negative("", "coefficient of friction at one of the speeds")
    }

    knots: AbstractVar[tuple[float, ...]]
    forces: AbstractVar[tuple[Scalar, ...]]

    def __check_init__(self) -> None:
        kind = type(self).__name__
        increasing = all(low < high < np.inf for low, high in zip(self.knots, self.knots[1:], strict=False))
        if len(self.knots) < 2 or self.knots[0] != 0 or not increasing:
            raise ValueError(
                f"knots of {kind} must be at least two speeds in m/s that increase from 0, got {self.knots}."
            )
        if len(self.forces) != len(self.knots):
            raise ValueError(
                f"forces of {kind} must be one coefficient for each of its {len(self.knots)} knots, "
                f"got {len(self.forces)}."
            )

    @classmethod
    def like(cls, law: AbstractFriction, knots: Iterable[float], load: float) -> "AbstractSpline":
        """The spline through the forces of another law, as a start for a fit.

        Args:
            law: any law; of a regularised one the force without the regularisation.
            knots: speeds [m/s], increasing from zero.
            load: normal force at which the law is evaluated [N].
        """
        speeds = _speeds(knots)
        forces = law.set_valued_limit().sliding_force(jnp.asarray(speeds), jnp.asarray(float(load)))
        # The converter of the field takes any list of numbers.
        return cls(speeds, np.asarray(forces) / load)  # pyright: ignore[reportCallIssue, reportArgumentType]

    @abc.abstractmethod
    def _slopes(self, widths: np.ndarray, rises: Array) -> Array:
        """Slopes at the knots in the stretched speed, zero at the last one.

        Args:
            widths: of the intervals between the knots, shape (n - 1,).
            rises: slopes of the straight lines across them, shape (n - 1,).
        """

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        ends = np.log1p(np.asarray(self.knots) / self.knots[1])
        widths, forces = np.diff(ends), jnp.stack(self.forces)
        rises = jnp.diff(forces) / widths
        slopes = self._slopes(widths, rises)
        # What an interval adds is constant beyond its ends, so that none has to be searched for. A speed just below
        # zero, as rounding makes it at a reversal, still belongs to the first one.
        at = jnp.log1p(speed / self.knots[1])[..., None]
        before, behind = at < np.append(-np.inf, ends[1:-1]), at >= ends[1:]
        way = jnp.where(behind, 1.0, jnp.where(before, 0.0, (at - ends[:-1]) / widths))
        turn = slopes[:-1] * (1 - way) - slopes[1:] * way
        added = widths * way * (rises * way * (3 - 2 * way) + turn * (1 - way))
        return load * (forces[0] + jnp.sum(added, axis=-1))

    def static_force(self, load: Scalar) -> Scalar:
        return self.forces[0] * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return jnp.min(jnp.stack(self.forces)) * load

    def velocity_scale(self) -> Scalar:
        return jnp.asarray(self.knots[1])


class Spline(AbstractSpline):
    """``F = N S(|v|) sgn(v)`` with a cubic spline ``S`` of continuous curvature; set-valued at rest up to ``S(0) N``.

    A fit frees the values by number: ``free=["forces_0", "forces_1", ...]``. :meth:`like` makes start values. Speeds
    that the run does not reach leave their value undetermined; put the last one near its highest speed.

    Attributes:
        knots: speeds [m/s], increasing from zero; about two for each halving of the speed resolve a Stribeck curve.
        forces: friction force over load at each of them [1]; at zero that with which sliding begins.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Spline(knots=[0.0, 5e-3, 2e-2], forces=[0.25, 0.21, 0.2])
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4865, 2.012 ], dtype=float64)
    """

    source: ClassVar[str] = "C. de Boor, A Practical Guide to Splines (1978), with the end conditions of a friction law"
    identifies: ClassVar[str] = (
        "the force from a few times the speed of the first knot up to the highest speed of the run; below, only how "
        "much work it takes. damping only where it is fixed, for the curve can take any part of it."
    )

    knots: tuple[float, ...] = eqx.field(static=True, converter=_speeds)
    forces: tuple[Scalar, ...] = eqx.field(converter=scalars)

    def _slopes(self, widths: np.ndarray, rises: Array) -> Array:
        return jnp.asarray(_smoothest(tuple(widths.tolist()))) @ rises


class MonotoneSpline(AbstractSpline):
    """As :class:`Spline`, but monotone between neighbouring speeds: its slopes are cut down where it would overshoot.

    Where they are cut its curvature jumps, so that a motion under it takes a mesh three times as fine; its derivatives
    with respect to the values jump where a cut begins.

    Attributes:
        knots: speeds [m/s], increasing from zero.
        forces: friction force over load at each of them [1]; at zero that with which sliding begins.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.MonotoneSpline(knots=[0.0, 5e-3, 2e-2], forces=[0.25, 0.21, 0.2])
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4865, 2.0173], dtype=float64)
    """

    source: ClassVar[str] = "J. M. Hyman, SIAM J. Sci. Stat. Comput. 4 (1983)"
    identifies: ClassVar[str] = Spline.identifies

    knots: tuple[float, ...] = eqx.field(static=True, converter=_speeds)
    forces: tuple[Scalar, ...] = eqx.field(converter=scalars)

    def _slopes(self, widths: np.ndarray, rises: Array) -> Array:
        beside = jnp.stack([jnp.append(rises[:1], rises), jnp.append(rises, rises[-1:])])
        # A cubic is monotone if its slopes at both ends are at most three times that of the line between them.
        lowest, highest = jnp.minimum(jnp.max(beside, axis=0), 0.0), jnp.maximum(jnp.min(beside, axis=0), 0.0)
        return jnp.clip(_smoothest(tuple(widths.tolist())) @ rises, 3 * lowest, 3 * highest)

    @property
    def step_refinement(self) -> int:
        return 3


@functools.cache
def _smoothest(widths: tuple[float, ...]) -> np.ndarray:
    """Matrix from the rises to the slopes of the spline that starts straight and ends level, shape (n, n - 1)."""
    n, h = len(widths) + 1, np.asarray(widths)
    bands, sides = np.eye(n), np.zeros((n, n - 1))
    bands[0, :2], sides[0, 0] = (2, 1), 3
    for i in range(1, n - 1):
        bands[i, i - 1 : i + 2] = h[i], 2 * (h[i - 1] + h[i]), h[i - 1]
        sides[i, i - 1 : i + 1] = 3 * h[i], 3 * h[i - 1]
    return np.linalg.solve(bands, sides)
