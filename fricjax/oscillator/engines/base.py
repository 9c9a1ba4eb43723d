"""Interface of the engines that compute a motion from a start."""

import abc
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator

UNTABLED = 2
"""Number of half-cycles before a stop that are integrated individually instead of interpolated in a table."""


class Demands(NamedTuple):
    """Requirements of a fit for its engine.

    Attributes:
        deflections: deflections at the start of the half-cycles of each record [m], without the last ones before a
            stop.
        accuracy: error of the motion that is negligible compared with the noise of all samples [m].
        from_rest: whether every motion starts from rest.
    """

    deflections: Sequence[np.ndarray]
    accuracy: float
    from_rest: bool


class AbstractPath(eqx.Module):
    """Motion that can be evaluated at any time; a pytree with tangents."""

    @property
    @abc.abstractmethod
    def turning_points(self) -> Float[Array, " turning_points"]:
        """Displacements at a start from rest and at each reversal [m].

        Padded with NaN; empty if not recorded.
        """

    @abc.abstractmethod
    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        """Return displacement [m] and velocity [m/s] at `ts` [s] after the start."""


class AbstractEngine(eqx.Module):
    """Method to integrate the equation of motion.

    Fields that determine the structure of the computation are static. Numbers such as a tolerance or a mesh are arrays,
    so a second call with the same shapes compiles nothing.

    Attributes:
        name: name for :func:`fricjax.simulate`.
        counted: entries of the `stats` of its motions.
        needs_mesh: whether a path requires a mesh found by an adaptive integration before it is a smooth function of
            the parameters.
        takes_drive: whether `solve` accepts a `drive`: floor motion, a decaying holding force.
    """

    name: eqx.AbstractClassVar[str]
    counted: ClassVar[tuple[str, ...]] = ()
    needs_mesh: eqx.AbstractClassVar[bool]
    takes_drive: ClassVar[bool] = False

    @staticmethod
    @abc.abstractmethod
    def refusal(oscillator: Oscillator) -> str | None:
        """Return the reason why an oscillator is unsupported, else None."""

    @abc.abstractmethod
    def tuned(self, oscillator: Oscillator, demands: Demands) -> "AbstractEngine":
        """Return the engine configured for a fit of these records."""

    @abc.abstractmethod
    def finer(self) -> "AbstractEngine":
        """Return an engine of the same kind with a clearly smaller error."""

    def checking(self) -> "AbstractEngine":
        """Return an engine for estimating the numerical error of this one.

        It has the same shapes, so both share a compiled program. Its error is clearly smaller, or of the same size but
        independent, for example on another mesh.
        """
        return self.finer()

    @abc.abstractmethod
    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        """Return the motion from time zero as a path.

        `half_cycles` is as in :meth:`solve`.
        """

    @abc.abstractmethod
    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        """Integrate from time zero and sample at `ts` [s].

        If `half_cycles` is given, a set-valued law stops the mass after that number of half-cycles, regardless of the
        rest condition. A fit takes the number from the record, which keeps its residual smooth.
        """

    def rest(self, oscillator: Oscillator, start: Start) -> Array:
        """Return the final displacement under a law with internal states [m].

        Raises:
            ValueError: the engine does not integrate such laws.
        """
        raise ValueError(f"{type(self).__name__} cannot say where a law with internal states stops. Use Smooth.")
