"""The interface of the engines: one oscillator, a start, the times asked for, and out comes the motion."""

import abc
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator

UNTABLED = 2
"""Half-cycles before a stop that are integrated each for itself, not read off a table."""


class Demands(NamedTuple):
    """What the records of a fit ask of its engine.

    Attributes:
        deflections: those of each record from which its half-cycles start, without the last ones before a stop [m].
        accuracy: error of the motion below which the noise of all samples leaves nothing visible [m].
        from_rest: whether every motion starts from rest.
    """

    deflections: Sequence[np.ndarray]
    accuracy: float
    from_rest: bool


class AbstractPath(eqx.Module):
    """A motion that can be read off at any time; a pytree, so that its tangents can be carried along."""

    @property
    @abc.abstractmethod
    def turning_points(self) -> Float[Array, " turning_points"]:
        """Displacements of a start at rest and of each reversal [m], NaN behind the last; empty if not recorded."""

    @abc.abstractmethod
    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        """Displacement [m] and velocity [m/s] at `ts` [s] after the start."""


class AbstractEngine(eqx.Module):
    """A way to integrate the equation of motion.

    What shapes the computation is static, and numbers such as a tolerance or a mesh are arrays, so that a second call
    of the same shape compiles nothing.

    Attributes:
        name: by which :func:`fricjax.simulate` knows it.
        counted: what the `stats` of its motions tell.
        needs_mesh: whether the steps of a motion have to be found before its path is a smooth function of it.
        takes_drive: whether `solve` takes a `drive`: a floor that moves, a holding force that decays.
    """

    name: eqx.AbstractClassVar[str]
    counted: ClassVar[tuple[str, ...]] = ()
    needs_mesh: eqx.AbstractClassVar[bool]
    takes_drive: ClassVar[bool] = False

    @staticmethod
    @abc.abstractmethod
    def refusal(oscillator: Oscillator) -> str | None:
        """Why such an engine cannot integrate this oscillator, in a sentence; None where it can."""

    @abc.abstractmethod
    def tuned(self, oscillator: Oscillator, demands: Demands) -> "AbstractEngine":
        """The engine that a fit of an oscillator to records asks for, from what they show."""

    @abc.abstractmethod
    def finer(self) -> "AbstractEngine":
        """An engine of the same kind whose numerical error is clearly smaller."""

    def checking(self) -> "AbstractEngine":
        """An engine that tells the numerical error of this one, of the same shape so that both share a compilation.

        Its own error is clearly smaller, or of the same size but another one: on another mesh.
        """
        return self.finer()

    @abc.abstractmethod
    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        """The motion from time zero, before it is sampled; `half_cycles` as in :meth:`solve`."""

    @abc.abstractmethod
    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        """Integrate from time zero and sample at `ts` [s].

        `half_cycles`, where given, is the number of half-cycles after which a set-valued law stops the mass, in
        place of the rest condition: a fit takes this number from the record, which keeps its residual smooth.
        """

    def rest(self, oscillator: Oscillator, start: Start) -> Array:
        """Where the contact of a law with internal states holds the mass [m].

        Raises:
            ValueError: an engine that does not integrate such laws.
        """
        raise ValueError(f"{type(self).__name__} cannot say where a law with internal states stops. Use Smooth.")
