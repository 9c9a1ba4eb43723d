"""What a fit makes small: the weighted distance of computed from measured displacement, and of values from priors."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimation.space import ParameterSpace
from ..oscillator import Motion, Oscillator, starting_state
from ..oscillator.engines import AbstractEngine, AbstractPath
from ..oscillator.engines.elementary import once
from ..oscillator.motion import Start

ERRORS = ("displacement_scale", "time_scale", "periodic_nonlinearity_cosine", "periodic_nonlinearity_sine")
"""What a reading may err by: true over displayed displacement and true over stated time, each less one, and the
amplitudes of an error that is periodic in the displacement [m]. A fit takes them for zero."""


# The parts of a problem are tuples: the host makes several of each for every run, and takes fifty times longer to read
# a field of a module of equinox, and a hundred to make one.
class Run(NamedTuple):
    """One record as the residual sees it, in numpy arrays until it is traced; times count from the run's own origin.

    Attributes:
        t: times [s], shape (samples,); those of samples that are not used are moved to the nearest used one.
        x: measured displacement [m], shape (samples,).
        weight: one over the noise [1/m], shape (samples,), zero where a sample is not used.
        half_cycles: number of half-cycles from the start to the stop, as the record shows it; huge where it ends in
            motion.
        fixed: x0, v0, offset, drift, t_release and z0 where they are not free.
        engine: the engine on a mesh that was made for this run; None where all runs share one.
    """

    t: Any
    x: Any
    weight: Any
    half_cycles: Any
    fixed: dict[str, Any]
    engine: AbstractEngine | None = None


class ObservedMotion(eqx.Module):
    """The motion of one run as its instrument sees it: a path that starts at `t_release`, with offset and drift.

    Attributes:
        errors: what the reading errs by, as in `ERRORS`, and `period` of the periodic error [m]; None where nothing is
            asked of them.
    """

    path: AbstractPath
    t_release: Float[Array, ""]
    offset: Float[Array, ""]
    drift: Float[Array, ""]
    errors: Float[Array, " errors"] | None = None
    period: Any = None

    def read(self, t: Float[Array, " samples"]) -> Float[Array, " samples"]:
        """Reading at times `t` of the run [m]."""
        x, v = self.path.sample(t - self.t_release)
        reading = x + self.offset + self.drift * t
        if self.errors is None:
            return reading
        phase = 2 * jnp.pi * reading / self.period
        # The errors are small, so that nothing is asked of how they depend on the motion in turn.
        by_error = jnp.stack([-reading, (v + self.drift) * t, jnp.cos(phase), jnp.sin(phase)])
        return reading + self.errors @ jax.lax.stop_gradient(by_error)


class Residual(NamedTuple):
    """The residual of one or several runs of the same machine, and of the priors, as a function of the coordinates.

    The coordinates are those of the free parameters, followed by one for each uncertain input of the rig in units of
    its standard uncertainty. The latter stay at zero; their columns of the Jacobian carry the inputs' uncertainty to
    the result.

    Attributes:
        oscillator: template of the machine; its free leaves are replaced.
        space: parameter space.
        engine: engine that computes the motions.
        runs: the records.
        prior_mean, prior_weight: mean and one over the standard deviation of each parameter's prior, weight zero for
            none.
        inputs: change of each leaf of the machine for one standard uncertainty of each input, and behind the leaves,
            where `period` is not None, of each of the `ERRORS` of the reading.
        period: displacement over which the periodic error of the reading repeats [m].
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
        """The residual with fields of its runs replaced, each by one entry for every run."""
        rows = zip(*columns.values(), strict=True)
        pairs = zip(self.runs, (dict(zip(columns, row, strict=True)) for row in rows), strict=True)
        return self._replace(runs=tuple(run._replace(**fields) for run, fields in pairs))

    def __call__(self, y: Float[Array, " coordinates"], args: None = None) -> Float[Array, " residuals"]:
        parts = self.each(lambda i, run: run.weight * (self.observed(y, i, run).read(run.t) - run.x), self.runs)
        return jnp.concatenate([*parts, self.priors(y)])

    def each(self, function: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        """What a function says of every run, from its number and its entry in each of the columns.

        Runs of the same shape are gone through by one compiled loop, so that many compile no longer than one.
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
        """Unit vectors along the coordinates on which the motion of a run depends: all but those of other runs."""
        p, shared, total = self.n_parameters, len(self.space.leaves), self.n_parameters + self.inputs.shape[0]
        if any(tie.parameter >= shared for tie in self.space.ties):
            return jnp.identity(total)
        along = jnp.array([*range(shared), *self.space.places(number).values(), *range(p, total)])
        return (along[:, None] == jnp.arange(total)) * 1.0

    def priors(self, y: Float[Array, " coordinates"]) -> Float[Array, " p"]:
        """Distance of the values to the means of their priors, in standard deviations."""
        return (self.values(y) - self.prior_mean) * self.prior_weight

    def values(self, y: Float[Array, " coordinates"]) -> Float[Array, " p"]:
        """Values of the free parameters."""
        return self.space.values(y[: self.n_parameters])

    def machine(self, y: Float[Array, " coordinates"]) -> Oscillator:
        """The oscillator at coordinates `y`."""
        return self._machine(y, self.values(y))

    def _machine(self, y: Float[Array, " coordinates"], values: Float[Array, " p"]) -> Oscillator:
        moved = self.oscillator
        if self.inputs.shape[0]:
            shift = y[self.n_parameters :] @ self.inputs
            leaves, structure = jax.tree.flatten(moved)
            moved = jax.tree.unflatten(structure, [leaf + shift[i] for i, leaf in enumerate(leaves)])
        # All over the program its coefficients would be computed anew.
        return once(self.space.model(moved, values))

    def run_parameters(self, values: Float[Array | np.ndarray, " p"], run: int) -> dict[str, Array]:
        """State and offset of one run, free or fixed, by name, from the values of the parameters."""
        return self.parameters_of_run(values, run, self.runs[run])

    def parameters_of_run(self, values: Float[Array | np.ndarray, " p"], number: Any, record: Run) -> dict[str, Array]:
        """The same of a run that is at hand with its number."""
        return {**record.fixed, **self.space.run_values(values, number)}

    def observed(self, y: Float[Array, " coordinates"], number: Any, record: Run) -> ObservedMotion:
        """Computed motion of the run of a number."""
        values = self.values(y)
        machine, at = self._machine(y, values), self.parameters_of_run(values, number, record)
        path = (record.engine or self.engine).path(machine, start_of(machine, at), record.half_cycles)
        parts = path, at["t_release"], at["offset"], at["drift"]
        if self.period is None:
            return ObservedMotion(*parts)
        return ObservedMotion(*parts, y[self.n_parameters :] @ self.inputs[:, -len(ERRORS) :], self.period)


def _are_alike(rows: Sequence[Any]) -> bool:
    """Whether rows differ in nothing but the numbers in their arrays."""

    def shape(row: Any) -> Any:
        leaves, structure = jax.tree.flatten(row)
        return structure, [np.shape(leaf) if eqx.is_array_like(leaf) else leaf for leaf in leaves]

    return all(shape(row) == shape(rows[0]) for row in rows)


def start_of(machine: Oscillator, at: Mapping[str, Any]) -> Start:
    """Start of a run: its internal states are `z0` times those after a slow pull, or after long sliding."""
    start = starting_state(machine, at["x0"], at["v0"])
    return start._replace(state=at.get("z0", 1.0) * start.state)


def without_inputs(residual: Residual) -> Residual:
    """The residual as a function of the coordinates of the free parameters alone."""
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
    """Motion of one run at its times `t`; `half_cycles` None lets the rest condition stop it."""
    return engine.solve(machine, start_of(machine, at), t - at["t_release"], half_cycles)


def power(count: int, least: int, factor: int = 2) -> int:
    """The first of `least`, `least` times `factor`, times `factor` again ... that is not below `count`."""
    size = least
    while size < count:
        size *= factor
    return size


def filled(count: int, least: int, most: int, factor: int) -> int:
    """The same up to a size of `most`, and beyond, where records are few and a filling costs, eighths of a power."""
    if count <= most:
        return power(count, least, factor)
    unit = power(count, most) // 8
    return -(-count // unit) * unit
