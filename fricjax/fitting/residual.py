"""What a fit makes small: the weighted distance between measured and computed displacement, and between priors and values."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..oscillator import Oscillator, starting_state
from ..oscillator.engines import AbstractEngine
from .space import ParameterSpace


class Run(eqx.Module):
    """One record as the residual sees it; times count from the run's own origin.

    Attributes:
        t: times [s]; those of samples that are not used are moved to the nearest used one.
        x: measured displacement [m].
        weight: one over the noise [1/m], zero where a sample is not used.
        half_cycles: number of half-cycles from the start to the stop, as the record shows it; huge where it ends in motion.
        fixed: x0, v0, offset, drift and t_release where they are not free.
    """

    t: Float[Array, " samples"]
    x: Float[Array, " samples"]
    weight: Float[Array, " samples"]
    half_cycles: Int[Array, ""]
    fixed: dict[str, Array]


class Residual(eqx.Module):
    """The residual of one or several runs of the same machine, and of the priors, as a function of the coordinates.

    Attributes:
        oscillator: template of the machine; its free leaves are replaced.
        space: parameter space.
        engine: engine that computes the motion.
        runs: the records.
        prior_mean, prior_weight: mean and one over the standard deviation of each parameter's prior, weight zero for none.
    """

    oscillator: Oscillator
    space: ParameterSpace
    engine: AbstractEngine
    runs: tuple[Run, ...]
    prior_mean: Float[Array, " p"]
    prior_weight: Float[Array, " p"]

    def __call__(self, q: Float[Array, " p"], args: None = None) -> Float[Array, " residuals"]:
        values = self.space.values(q)
        machine = self.space.oscillator(self.oscillator, values)
        parts = [run.weight * (self.displacement(machine, values, i) - run.x) for i, run in enumerate(self.runs)]
        return jnp.concatenate([*parts, (values - self.prior_mean) * self.prior_weight])

    def displacement(self, machine: Oscillator, values: Float[Array, " p"], run: int) -> Float[Array, " samples"]:
        """Computed displacement of one run in the coordinate of its record [m]."""
        return displacement(self.engine, machine, self.runs[run], self.space.run_values(values, run), self.runs[run].t)


def displacement(
    engine: AbstractEngine,
    machine: Oscillator,
    run: Run,
    own: dict[str, Array],
    t: Float[Array, " samples"],
) -> Float[Array, " samples"]:
    """What the instrument would read at times `t` of a run, given the values of its own parameters."""
    at = {**run.fixed, **own}
    start = starting_state(machine, at["x0"], at["v0"])
    motion = engine.solve(machine, start, t - at["t_release"], run.half_cycles)
    return motion.x + at["offset"] + at["drift"] * t
