"""Integration in time, for laws without a jump: bristle laws, regularised laws and their creep, driven motion.

An adaptive integration is a rough function of its parameters, since each choice of steps has its own error. For a
fit the steps are found once and kept as a mesh in the phase of the half-cycles, and behind the last ones in time: the
motion is then a smooth function of every coefficient, and its derivatives are exactly those of the discrete solution.
"""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from ...motion import Motion, Start
from ...oscillator import Drive, Oscillator
from ..base import AbstractEngine, Demands
from ..nodes import Nodes
from .mesh import Mesh

# What a motion is traced from is imported where it is traced: with diffrax it takes longer than a fit, and a process
# that recalls its programs needs neither.

# How much finer a motion is integrated of which only the end is asked for.
_FINER = 100.0


class Smooth(AbstractEngine):
    """Integration in time with a Rosenbrock solver, and on a mesh over the phase of the half-cycles first.

    Attributes:
        accuracy: largest error of the displacement aimed at [m].
        mesh: ends of the steps for :meth:`path`; :meth:`solve` lets the error estimate choose them.
        max_steps: bound on the number of steps.
        max_half_cycles: length of the list of turning points, and most half-cycles of a mesh in phase.
        still: way on which a contact may still spring back and ring while the mass is taken to be at rest [m]. It is
            far below the accuracy, for a lightly damped contact creeps under its ringing, hundreds of times as far.
        method: solver of diffrax for :meth:`solve`, with its own controller; None: Rodas5P where a law is stiff, else
            Dopri8, by steps that end at reversals.

    Examples:
        >>> print(f"{Smooth(accuracy=1e-10).finer().accuracy:.0e} m")
        1e-11 m
    """

    name: ClassVar[str] = "smooth"
    counted: ClassVar[tuple[str, ...]] = ("num_steps", "num_rejected_steps")
    needs_mesh: ClassVar[bool] = True
    takes_drive: ClassVar[bool] = True
    accuracy: float | Float[Array | np.ndarray, ""] = 1e-10
    mesh: Mesh | None = None
    max_steps: int = eqx.field(static=True, default=1_000_000)
    max_half_cycles: int = eqx.field(static=True, default=512)
    still: float | Float[Array | np.ndarray, ""] = 1e-13
    # Of its fields some are no arrays, so that it shapes the computation.
    method: eqx.Module | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        if self.method is None:
            return
        import diffrax

        if not isinstance(self.method, diffrax.AbstractAdaptiveSolver):
            raise ValueError(
                f"method must be an adaptive solver such as diffrax.Kvaerno5(), got a {type(self.method).__name__}."
            )

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        if oscillator.friction.set_valued:
            return (
                f"The smooth engine cannot integrate the jump of {type(oscillator.friction).__name__}. Use the exact "
                "or the hybrid engine, or a regularised law such as Tanh."
            )
        if oscillator.restoring.hysteretic:
            return (
                "The smooth engine cannot integrate the internal friction of a structural spring, which jumps at each "
                "reversal. Use the hybrid engine with a law without internal states."
            )
        return None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Smooth":
        # Its error is some ten times smaller than the accuracy that it is asked for.
        accuracy = np.asarray(demands.accuracy)
        # On its mesh a list costs nothing, so that all records may share one capacity.
        capacity = max(Smooth().max_half_cycles, self.max_half_cycles)
        return Smooth(accuracy, None, self.max_steps, capacity, accuracy)

    def finer(self) -> "Smooth":
        return self.at_accuracy(self.accuracy / 10)

    def at_accuracy(self, accuracy: Any) -> "Smooth":
        """The engine without a mesh, for another accuracy [m]."""
        return dataclasses.replace(self, accuracy=accuracy, mesh=None)

    def on_mesh(self, phases: np.ndarray, times: np.ndarray, size: int) -> "Smooth":
        """The engine with the steps of `meshed`, in a list with room for `size` of them."""
        return dataclasses.replace(self, mesh=Mesh.of(phases, times, size))

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> Nodes:
        """The motion from time zero to the end of the mesh, where the mass stays.

        Raises:
            ValueError: an engine without a mesh, whose steps depend on the parameters.
        """
        from . import integration

        return integration.path(self, oscillator, start)

    def trail(self, oscillator: Oscillator, start: Start, duration: Float[Array, ""]) -> Nodes:
        """The motion at the ends of the steps that the error estimate chooses, up to `duration` [s].

        It ends earlier where `max_steps` are not enough; unused nodes repeat the last one.
        """
        from . import integration

        return integration.trail(self, oscillator, start, duration)

    def meshed(
        self, oscillator: Oscillator, start: Start, duration: Array, half_cycles: Array | None, capacity: int
    ) -> tuple[Array, Array]:
        """Phases and times of the steps that the error estimate chooses until `duration` [s], for `Mesh.of`.

        Beyond the last one of each list there is inf; not so where `capacity` steps do not lead to the end, and the
        list is full. The phases end at the last reversal, after `half_cycles` where these are known, and the times
        where the mass rests.
        """
        from . import integration

        return integration.meshed(self, oscillator, start, duration, half_cycles, capacity)

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
        drive: Drive | None = None,
    ) -> Motion:
        from . import integration

        return integration.solve(self, oscillator, start, ts, drive)

    def rest(self, oscillator: Oscillator, start: Start) -> Array:
        """Where the mass comes to rest [m]; NaN where it still moves after `max_steps` or ten thousand half-periods."""
        from . import integration

        # A contact may ring for thousands of swings, whose errors add up.
        fine = Smooth(self.accuracy / _FINER, max_steps=self.max_steps, still=self.still)
        return integration.rest(fine, oscillator, start)
