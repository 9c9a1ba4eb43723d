"""Friction forces without a formula: smooth curves through values at given speeds.

Between neighbouring speeds the force is a cubic in the stretched speed ``s = ln(1 + v/v_1)``, where ``v_1`` is the
first speed above zero. In this variable a force that changes over decades of speed changes evenly. Beyond the last
speed the force is constant.
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
    """A piecewise cubic through free values.

    The final classes define its slopes at the knots.

    Attributes:
        knots: speeds [m/s], increasing from zero.
        forces: friction force over load at each knot [1]; the value at zero is that at the start of sliding.

    Raises:
        ValueError: the speeds do not increase from zero, or the number of forces is different.
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "forces": not_negative("", "coefficient of friction at one of the knots")
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
        """Return the spline through the forces of another law.

        Use it as the start of a fit.

        Args:
            law: any law; a regularised law is evaluated without its regularisation.
            knots: speeds [m/s], increasing from zero.
            load: normal force at which the law is evaluated [N].
        """
        speeds = _speeds(knots)
        forces = law.set_valued_limit().sliding_force(jnp.asarray(speeds), jnp.asarray(float(load)))
        # The converter of the field accepts any list of numbers.
        return cls(speeds, np.asarray(forces) / load)  # pyright: ignore[reportCallIssue, reportArgumentType]

    @abc.abstractmethod
    def _slopes(self, widths: np.ndarray, rises: Array) -> Array:
        """Slopes at the knots in the stretched speed.

        The slope at the last knot is zero.

        Args:
            widths: widths of the intervals between the knots, shape (n - 1,).
            rises: slopes of the straight lines across the intervals, shape (n - 1,).
        """

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        ends = np.log1p(np.asarray(self.knots) / self.knots[1])
        widths, forces = np.diff(ends), jnp.stack(self.forces)
        rises = jnp.diff(forces) / widths
        slopes = self._slopes(widths, rises)
        # The contribution of an interval is constant beyond its ends, so no search for the interval is needed. A speed
        # just below zero, from rounding at a reversal, still belongs to the first interval.
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

    @property
    def kink_speeds(self) -> tuple[float, ...]:
        return self.knots[1:]


class Spline(AbstractSpline):
    """Friction law given by a cubic spline with continuous curvature.

    ``F = N S(|v|) sgn(v)`` with a cubic spline ``S``. At rest the friction force is at most ``S(0) N``.

    A fit frees the values by number: ``free=["forces_0", "forces_1", ...]``. :meth:`like` gives start values. A value
    at a speed above the highest speed of the run is undetermined, so put the last knot near this speed.

    Attributes:
        knots: speeds [m/s], increasing from zero; about two per factor of two in speed resolve a Stribeck curve.
        forces: friction force over load at each knot [1]; the value at zero is that at the start of sliding.

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
        "the force from a few times the speed of the first knot up to the highest speed of the run; at lower speeds "
        "only the work of the force. Fix damping, because the curve can absorb any part of it."
    )

    knots: tuple[float, ...] = eqx.field(static=True, converter=_speeds)
    forces: tuple[Scalar, ...] = eqx.field(converter=scalars)

    def _slopes(self, widths: np.ndarray, rises: Array) -> Array:
        return jnp.asarray(_smoothest(tuple(widths.tolist()))) @ rises


class MonotoneSpline(AbstractSpline):
    """Friction law given by a cubic spline that is monotone between knots.

    The law is :class:`Spline` with smaller slopes at knots where the spline would overshoot. The curvature jumps at
    such a knot, so the motion needs a mesh three times as fine. The derivatives with respect to the values jump when
    the limit on a slope becomes active.

    Attributes:
        knots: speeds [m/s], increasing from zero.
        forces: friction force over load at each knot [1]; the value at zero is that at the start of sliding.

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
        adjacent = jnp.stack([jnp.append(rises[:1], rises), jnp.append(rises, rises[-1:])])
        # A cubic is monotone if its slopes at both ends are at most three times the slope of the line between them.
        lowest, highest = jnp.minimum(jnp.max(adjacent, axis=0), 0.0), jnp.maximum(jnp.min(adjacent, axis=0), 0.0)
        return jnp.clip(_smoothest(tuple(widths.tolist())) @ rises, 3 * lowest, 3 * highest)

    @property
    def step_refinement(self) -> int:
        return 3


@functools.cache
def _smoothest(widths: tuple[float, ...]) -> np.ndarray:
    """Matrix from rises to slopes, shape (n, n - 1).

    The spline has zero curvature at the first knot and zero slope at the last one.
    """
    n, h = len(widths) + 1, np.asarray(widths)
    bands, sides = np.eye(n), np.zeros((n, n - 1))
    bands[0, :2], sides[0, 0] = (2, 1), 3
    for i in range(1, n - 1):
        bands[i, i - 1 : i + 2] = h[i], 2 * (h[i - 1] + h[i]), h[i - 1]
        sides[i, i - 1 : i + 1] = 3 * h[i], 3 * h[i - 1]
    return np.linalg.solve(bands, sides)
