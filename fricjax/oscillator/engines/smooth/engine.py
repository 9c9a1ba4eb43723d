"""Integration in time for laws without a jump.

These are bristle laws and regularised laws with their creep, including driven motion. An adaptive integration is a
rough function of its parameters, since each choice of steps has a different error. A fit therefore finds the steps once
and keeps them as a mesh, in the phase of the half-cycles and then in time. The motion is then a smooth function of
every coefficient, and its derivatives are exactly those of the discrete solution.
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

# Modules for tracing are imported when tracing. diffrax takes longer to import than a fit, and a process with cached
# programs does not need it.

# Accuracy factor for computing only the end of a motion.
_FINER = 100.0


class Smooth(AbstractEngine):
    """Adaptive integration in time, or on a mesh in phase and time.

    Attributes:
        accuracy: target for the largest error of the displacement [m].
        mesh: ends of the steps for :meth:`path`; :meth:`solve` chooses steps by the error estimate.
        max_steps: maximum number of steps.
        max_half_cycles: length of the list of turning points, and maximum number of half-cycles of a mesh in phase.
        still: distance over which the contact may still spring back and vibrate while the mass counts as resting [m].
            It is far below the accuracy, since a lightly damped contact creeps hundreds of times further while it
            vibrates.
        method: diffrax solver for :meth:`solve`, with PID step control. None selects Rodas5P for stiff laws, else
            Dopri8, with steps that end at reversals.

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
    # Static, since some of its fields are not arrays.
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
        # The actual error is about ten times smaller than the requested accuracy.
        accuracy = np.asarray(demands.accuracy)
        # Capacity costs nothing on a mesh, so all records share one.
        capacity = max(Smooth().max_half_cycles, self.max_half_cycles)
        return Smooth(accuracy, None, self.max_steps, capacity, accuracy)

    def finer(self) -> "Smooth":
        return self.at_accuracy(self.accuracy / 10)

    def at_accuracy(self, accuracy: Any) -> "Smooth":
        """Return the engine without a mesh, for another accuracy [m]."""
        return dataclasses.replace(self, accuracy=accuracy, mesh=None)

    def on_mesh(self, phases: np.ndarray, times: np.ndarray, size: int) -> "Smooth":
        """Return the engine with the steps of `meshed`, padded to `size`."""
        return dataclasses.replace(self, mesh=Mesh.of(phases, times, size))

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> Nodes:
        """Return the motion from time zero to the end of the mesh.

        The mass stays there.

        Raises:
            ValueError: an engine without a mesh; its steps would depend on the parameters.
        """
        from . import integration

        return integration.path(self, oscillator, start)

    def trail(self, oscillator: Oscillator, start: Start, duration: Float[Array, ""]) -> Nodes:
        """Integrate up to `duration` [s] with steps chosen by the error estimate.

        The nodes are the ends of the steps. The motion ends earlier if it needs more than `max_steps` steps; unused
        nodes repeat the last one.
        """
        from . import integration

        return integration.trail(self, oscillator, start, duration)

    def meshed(
        self, oscillator: Oscillator, start: Start, duration: Array, half_cycles: Array | None, capacity: int
    ) -> tuple[Array, Array]:
        """Choose phases and times of steps until `duration` [s], for `Mesh.of`.

        Each list is padded with inf; a list without inf means that `capacity` steps were not enough. The phases end at
        the last reversal, after `half_cycles` if given. The times end when the mass rests.
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
        """Return the final displacement of the mass [m].

        NaN if it still moves after `max_steps` steps or ten thousand half-periods.
        """
        from . import integration

        # A contact may vibrate for thousands of periods, and the errors add up.
        fine = Smooth(self.accuracy / _FINER, max_steps=self.max_steps, still=self.still)
        return integration.rest(fine, oscillator, start)
