"""What a planned run will tell: the information matrix with everything that follows from it."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..estimation.covariance import correlation
from ..fitting.derived import Estimate
from ..oscillator import Oscillator
from .directions import Direction
from .plan import Course

_SEEN = 1e-6


@dataclasses.dataclass(frozen=True, eq=False)
class Information:
    """What a planned run will tell.

    Attributes:
        names: coefficients and then nuisances of the run, in the order of all matrices.
        values, units: by name, SI.
        matrix: Fisher information, in the inverse units of the parameters, shape (p, p).
        inverse: its generalised inverse, shape (p, p); the expected covariance among what is determined.
        rank: number of directions among the parameters that the run determines.
        condition: condition number of the derivatives, each scaled to unit length, without those of `idle`; inf where
            a direction is undetermined.
        singular: undetermined directions, each in words.
        idle: parameters on which the motion does not depend at all.
        slopes: quantities that need no rig, each with its value, its unit and its derivatives by name.
        course: turning points and stop of the planned motion.
        x0: displacement at release [m].
        samples, rate, duration, noise: of the planned record [1], [1/s], [s], [m].
        engine: name of the engine.
        oscillator: the machine.
    """

    names: tuple[str, ...]
    values: dict[str, float]
    units: dict[str, str]
    matrix: np.ndarray
    inverse: np.ndarray
    rank: int
    condition: float
    singular: tuple[Direction, ...]
    idle: tuple[str, ...]
    slopes: Mapping[str, tuple[float, str, Mapping[str, float]]]
    course: Course
    x0: float
    samples: int
    rate: float
    duration: float
    noise: float
    engine: str
    oscillator: Oscillator

    def std_of(self, derivatives: Mapping[str, float]) -> float:
        """Expected standard error of a quantity with these derivatives by name; inf where it is not determined."""
        slope = np.array([derivatives.get(name, 0.0) for name in self.names])
        for direction in self.singular:
            change = np.array([slope[self.names.index(name)] for name in direction.names]) * direction.changes
            if abs(change.sum()) > _SEEN * np.abs(change).sum():
                return np.inf
        if any(derivatives.get(name) for name in self.idle):
            return np.inf
        return float(np.sqrt(max(slope @ self.inverse @ slope, 0.0)))

    @functools.cached_property
    def std_errors(self) -> dict[str, float]:
        """Expected standard errors by name; inf where the run does not determine a parameter."""
        return {name: self.std_of({name: 1.0}) for name in self.names}

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the run does not determine."""
        return tuple(name for name in self.names if not np.isfinite(self.std_errors[name]))

    @property
    def _lost(self) -> np.ndarray:
        """Where a parameter is undetermined, shape (p,)."""
        return np.array([name in self.undetermined for name in self.names])

    @property
    def covariance(self) -> np.ndarray:
        """Expected covariance, inf where undetermined, shape (p, p)."""
        found, lost = self.inverse.copy(), self._lost
        found[lost, :] = found[:, lost] = 0.0
        found[lost, lost] = np.inf
        return found

    @property
    def correlation(self) -> np.ndarray:
        """Expected correlation matrix, shape (p, p); NaN where undetermined."""
        found, lost = correlation(self.covariance), self._lost
        found[lost, :] = found[:, lost] = np.nan
        return found

    def correlation_of(self, first: str, second: str) -> float:
        """Expected correlation of two parameters; NaN where one is undetermined."""
        return float(self.correlation[self.names.index(first), self.names.index(second)])

    @property
    def kinematics(self) -> dict[str, Estimate]:
        """What needs no rig: natural frequency, damping ratio, dead band, and losses per unit mass."""
        return {name: Estimate(value, self.std_of(by), unit) for name, (value, unit, by) in self.slopes.items()}

    @property
    def combinations(self) -> dict[str, Estimate]:
        """Combinations of a static coefficient and a Stribeck velocity, which a run often tells only together."""
        from .ridge import combinations

        return combinations(self)

    @property
    def errors(self) -> tuple[str, ...]:
        """What keeps a fit from being valid: parameters without effect and undetermined directions, with a remedy."""
        from .advice import errors

        return errors(self)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Advice on the run, in sentences."""
        from .advice import remarks

        return remarks(self)

    def summary(self) -> str:
        """The report as plain text."""
        from .show import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from .show import html

        return html(self)

    def __repr__(self) -> str:
        found = ", ".join(f"{name}: {std:.2g}" for name, std in self.std_errors.items())
        return f"Information(expected standard errors: {found})"

    def plot(self) -> Any:
        """Relative standard errors as bars, and the correlations as a map, as a matplotlib figure."""
        from .show import plot

        return plot(self)

    def to_dict(self) -> dict[str, Any]:
        """The report as plain data."""
        from .show import to_dict

        return to_dict(self)
