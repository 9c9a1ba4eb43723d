"""The residual: weighted differences of displacements and of priors."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.observation import DISPLACEMENT, Observation
from ..estimation.space import ParameterSpace
from ..oscillator import Motion, Oscillator, starting_state
from ..oscillator.engines import AbstractEngine, AbstractPath
from ..oscillator.engines.elementary import once
from ..oscillator.motion import Start

ERRORS = ("displacement_scale", "time_scale", "periodic_nonlinearity_cosine", "periodic_nonlinearity_sine")
"""Relative errors of a reading: true over displayed displacement and true over stated time, each minus one, and the
amplitudes of an error that is periodic in the displacement [m]. A fit assumes that they are zero."""

# An observation is a setting of a run: it has no leaves, and its fields are part of the structure.
jax.tree_util.register_pytree_node(
    Observation,
    lambda each: ((), (each.kind, each.motion, each.length, each.angle)),
    lambda fields, _: Observation(*fields),
)


# The parts of a problem are tuples. For each run several are made, and equinox modules are 50 times slower to read and
# 100 times slower to make.
class Run(NamedTuple):
    """One record for the residual, in numpy arrays until it is traced.

    Times are relative to the origin of the run.

    Attributes:
        t: times [s], shape (samples,); unused samples have the time of the nearest used one.
        x: measured reading, such as a displacement [m], shape (samples,).
        weight: one over the noise of the reading, shape (samples,); zero for unused samples.
        half_cycles: number of half-cycles from the start to the stop in the record; huge if it ends in motion.
        fixed: those of x0, v0, offset, drift, t_release and z0 that are not free.
        engine: engine with the mesh of this run; None if all runs share an engine.
        observation: map from the motion to the reading.
    """

    t: Any
    x: Any
    weight: Any
    half_cycles: Any
    fixed: dict[str, Any]
    engine: AbstractEngine | None = None
    observation: Observation = DISPLACEMENT


class ObservedMotion(eqx.Module):
    """Motion of one run as its instrument reads it.

    It is a path that starts at `t_release`, with offset and drift.

    Attributes:
        observation: map from the motion to the reading.
        errors: errors of the reading, as in `ERRORS`, and `period` of the periodic one [m]; None without them.
    """

    path: AbstractPath
    t_release: Float[Array, ""]
    offset: Float[Array, ""]
    drift: Float[Array, ""]
    observation: Observation = DISPLACEMENT
    errors: Float[Array, " errors"] | None = None
    period: Any = None

    def read(self, t: Float[Array, " samples"]) -> Float[Array, " samples"]:
        """Return the reading at times `t` of the run, in its unit."""
        observation, derivatives = self.observation, self._derivatives(t - self.t_release)
        value = derivatives[observation.order]
        reading = observation.read(value, jnp) + self.offset + self.drift * t
        if self.errors is None:
            return reading
        rate = observation.slope(value, jnp) * derivatives[observation.order + 1] + self.drift
        # The errors are small, so their dependence on the motion is neglected.
        by_error = errors_of_reading(observation, reading, rate, t, self.period, jnp)
        return reading + self.errors @ jax.lax.stop_gradient(by_error)

    def _derivatives(self, t: Float[Array, " samples"]) -> list[Array]:
        """Return the displacement and its derivatives by time, as far as needed."""
        derivatives = list(self.path.sample(t))
        rate = lambda at: self.path.sample(at)[1]
        while len(derivatives) < self.observation.order + (1 if self.errors is None else 2):
            rate = lambda at, of=rate: jax.jvp(of, (at,), (jnp.ones_like(at),))[1]
            derivatives.append(rate(t))
        return derivatives


def errors_of_reading(observation: Observation, reading: Any, rate: Any, t: Any, period: Any, xp: Any) -> Any:
    """Return the derivatives of a reading by its `ERRORS`, shape (errors, samples).

    Args:
        observation: map from the motion to the reading. Only a displacement has an error periodic in it.
        reading: reading, shape (samples,).
        rate: its derivative by time, shape (samples,).
        t: times of the run [s], shape (samples,).
        period: period of the periodic error [m].
        xp: `numpy` or `jax.numpy`.
    """
    phase = 2 * np.pi * reading / period
    waves = 1.0 if observation.kind == "displacement" else 0.0
    return xp.stack([-reading, rate * t, waves * xp.cos(phase), waves * xp.sin(phase)])


class Residual(NamedTuple):
    """Residual of runs of one machine, and of priors, by coordinates.

    The first coordinates are those of the free parameters. One for each uncertain input of the rig follows, in units of
    its standard uncertainty. The latter stay at zero; their columns of the Jacobian propagate the uncertainty of the
    inputs to the result.

    Attributes:
        oscillator: template of the machine; its free leaves are replaced.
        space: parameter space.
        engine: engine that computes the motions.
        runs: the records.
        prior_mean, prior_weight: mean and inverse standard deviation of each parameter's prior; weight zero for none.
        inputs: change of each leaf of the machine per standard uncertainty of each input. If `period` is not None,
            changes of the `ERRORS` of the reading follow.
        period: period of the periodic error of the reading [m].
    """

    oscillator: Oscillator
    space: ParameterSpace
    engine: AbstractEngine
    runs: tuple[Run, ...]
    prior_mean: Float[Array | np.ndarray, " p"]
    prior_weight: Float[Array | np.ndarray, " p"]
    inputs: Float[Array | np.ndarray, "inputs changes"]
    period: Any = None

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""
        return self.prior_mean.shape[0]

    def with_runs(self, **columns: Iterable[Any]) -> "Residual":
        """Return the residual with fields of its runs replaced.

        Each keyword gives one entry for every run.
        """
        rows = zip(*columns.values(), strict=True)
        pairs = zip(self.runs, (dict(zip(columns, row, strict=True)) for row in rows), strict=True)
        return self._replace(runs=tuple(run._replace(**fields) for run, fields in pairs))

    def __call__(self, y: Float[Array, " coordinates"], args: None = None) -> Float[Array, " residuals"]:
        parts = self.each(lambda i, run: run.weight * (self.observed(y, i, run).read(run.t) - run.x), self.runs)
        return jnp.concatenate([*parts, self.priors(y)])

    def each(self, function: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        """Apply a function to the number and the columns of every run.

        Runs of equal shape use one compiled loop, so many runs compile as fast as one.
        """
        rows = list(zip(*columns, strict=True))
        if len(rows) == 1 or not (self.space.alike and _are_alike(rows)):
            return [function(i, *row) for i, row in enumerate(rows)]
        arrays, settings = zip(*(eqx.partition(row, eqx.is_array_like) for row in rows), strict=True)
        stacked = jax.tree.map(lambda *values: jnp.stack(values), *arrays)

        def one(numbered: tuple[Array, Any]) -> Any:
            return function(numbered[0], *eqx.combine(numbered[1], settings[0]))

        results = jax.lax.map(one, (jnp.arange(len(rows)), stacked))
        return [jax.tree.map(lambda values, i=i: values[i], results) for i in range(len(rows))]

    def directions(self, number: Any) -> Float[Array, "directions coordinates"]:
        """Return unit vectors along the coordinates that affect a run.

        These are all coordinates except those of other runs.
        """
        p, shared, total = self.n_parameters, len(self.space.leaves), self.n_parameters + self.inputs.shape[0]
        if any(tie.parameter >= shared for tie in self.space.ties):
            return jnp.identity(total)
        along = jnp.array([*range(shared), *self.space.places(number).values(), *range(p, total)])
        return (along[:, None] == jnp.arange(total)) * 1.0

    def priors(self, y: Float[Array, " coordinates"]) -> Float[Array, " p"]:
        """Return deviations of the values from their prior means, in standard deviations."""
        return (self.values(y) - self.prior_mean) * self.prior_weight

    def values(self, y: Float[Array, " coordinates"]) -> Float[Array, " p"]:
        """Return the values of the free parameters."""
        return self.space.values(y[: self.n_parameters])

    def machine(self, y: Float[Array, " coordinates"]) -> Oscillator:
        """Return the oscillator at coordinates `y`."""
        return self._machine(y, self.values(y))

    def _machine(self, y: Float[Array, " coordinates"], values: Float[Array, " p"]) -> Oscillator:
        moved = self.oscillator
        if self.inputs.shape[0]:
            shift = y[self.n_parameters :] @ self.inputs
            leaves, structure = jax.tree.flatten(moved)
            moved = jax.tree.unflatten(structure, [leaf + shift[i] for i, leaf in enumerate(leaves)])
        # Without a barrier XLA would compute its coefficients again at each use.
        return once(self.space.model(moved, values))

    def run_parameters(self, values: Float[Array | np.ndarray, " p"], run: int) -> dict[str, Array]:
        """Return state and offset of one run by name, free or fixed."""
        return self.parameters_of_run(values, run, self.runs[run])

    def parameters_of_run(self, values: Float[Array | np.ndarray, " p"], number: Any, record: Run) -> dict[str, Array]:
        """Return the same for a given record and its number."""
        return {**record.fixed, **self.space.run_values(values, number)}

    def observed(self, y: Float[Array, " coordinates"], number: Any, record: Run) -> ObservedMotion:
        """Return the computed motion of a run."""
        values = self.values(y)
        machine, at = self._machine(y, values), self.parameters_of_run(values, number, record)
        path = (record.engine or self.engine).path(machine, start_of(machine, at), record.half_cycles)
        parts = path, at["t_release"], at["offset"], at["drift"], record.observation
        if self.period is None:
            return ObservedMotion(*parts)
        return ObservedMotion(*parts, y[self.n_parameters :] @ self.inputs[:, -len(ERRORS) :], self.period)


def _are_alike(rows: Sequence[Any]) -> bool:
    """Return True if rows differ only in the values of their arrays."""

    def shape(row: Any) -> Any:
        leaves, structure = jax.tree.flatten(row)
        return structure, [np.shape(leaf) if eqx.is_array_like(leaf) else leaf for leaf in leaves]

    return all(shape(row) == shape(rows[0]) for row in rows)


def start_of(machine: Oscillator, at: Mapping[str, Any]) -> Start:
    """Return the start of a run, with internal states scaled by `z0`.

    At `z0` = 1 they are those after a slow pull, or after long sliding.
    """
    start = starting_state(machine, at["x0"], at["v0"])
    return start._replace(state=at.get("z0", 1.0) * start.state)


def without_inputs(residual: Residual) -> Residual:
    """Return the residual as a function of the free parameters alone."""
    leaves = len(jax.tree.leaves(residual.oscillator))
    return residual._replace(inputs=residual.inputs[:0, :leaves], period=None)


@eqx.filter_jit
def motion(
    engine: AbstractEngine,
    machine: Oscillator,
    at: dict[str, Any],
    t: Float[Array | np.ndarray, " samples"],
    half_cycles: Any,
) -> Motion:
    """Return the motion of one run at its times `t`.

    With `half_cycles` None the rest condition stops it.
    """
    return engine.solve(machine, start_of(machine, at), t - at["t_release"], half_cycles)


def power(count: int, least: int, factor: int = 2) -> int:
    """Return the first of `least` times powers of `factor` not below `count`."""
    size = least
    while size < count:
        size *= factor
    return size


def filled(count: int, least: int, most: int, factor: int) -> int:
    """Return the padded size for `count` samples.

    Up to `most` it is a power. Beyond, where records are rare and padding is expensive, it is a multiple of an eighth
    of a power of two.
    """
    if count <= most:
        return power(count, least, factor)
    unit = power(count, most) // 8
    return -(-count // unit) * unit
