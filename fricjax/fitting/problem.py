"""The problem to solve: parameters with start values, and the residual."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ..data import Record, Trace
from ..data.record import labels
from ..data.repair import reported_faults
from ..errors import DataError, UsageError
from ..estimation.loss import AbstractLoss
from ..estimation.space import LINEAR, Parameter, ParameterSpace, Tie
from ..oscillator.engines import AbstractEngine, Demands
from ..oscillator.engines.base import UNTABLED
from ..oscillator.oscillator import leaves_of
from ..oscillator.select import select_engine
from ..rig import Measured
from .condense import Condensation
from .names import tied
from .parameters import Request, free_parameters, parse_priors, shared_leaves
from .residual import Residual, power, without_inputs
from .rig_inputs import contradiction, rig_inputs
from .runs import clear_of_jumps, condensation, condensed_run, full_run, longer, of_one_length, stage_weights_of
from .stages import Limits, StageWeights
from .tabulate import Tables
from .window import NEVER, Window, equilibrium, open_window

# Least number of half-cycles to provide for, so that records of an archive share their compilation.
_CAPACITY = 64


@dataclasses.dataclass(frozen=True)
class Problem:
    """A fit before it is solved.

    Attributes:
        residual: residual of all samples, with the inputs of the rig.
        condensed: the same with far fewer samples but equal normal equations, without the inputs; it is solved.
        stage_weights: weights of each run for the stages of a fit, at the condensed samples.
        limits: bounds in coordinates.
        loss: loss of the residuals; `noise`: name of the noise model.
        parameters: the free parameters in order; `inputs`: the uncertain inputs of the rig, by name.
        windows: the fitted part of each record.
        bracketed: name of a static coefficient that the user freed and that is bracketed instead of fitted.
        made: True if its records were made from the fitted model, which is then complete.
        request: arguments of the fit.
    """

    residual: Residual
    condensed: Residual
    stage_weights: tuple[StageWeights, ...]
    limits: Limits
    loss: AbstractLoss
    parameters: tuple[Parameter, ...]
    inputs: dict[str, Measured]
    windows: tuple[Window, ...]
    bracketed: str | None
    noise: str = "auto"
    made: bool = False
    request: Request | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each run in messages."""
        return labels([window.name for window in self.windows])

    @property
    def origins(self) -> np.ndarray:
        """Time offset from run to record for release times, shape (p,).

        It is zero for other parameters.
        """
        origins = np.zeros(len(self.names))
        for run, window in enumerate(self.windows):
            place = self.residual.space.places(run).get("t_release")
            if place is not None:
                origins[place] = window.origin
        return origins

    def by_run(self, residual: Any) -> list[np.ndarray]:
        """Split the weighted residual by run, at the samples of its record.

        Residuals of the priors are dropped.
        """
        ends = np.cumsum([run.t.shape[0] for run in self.residual.runs])
        parts = np.split(np.asarray(residual), ends)[:-1]
        return [part[: window.used.size] for part, window in zip(parts, self.windows, strict=True)]

    @property
    def n_used(self) -> int:
        """Number of fitted samples."""
        return int(sum(window.used.sum() for window in self.windows))

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return max(self.n_used + self.n_priors - len(self.parameters), 1)

    @property
    def n_priors(self) -> int:
        """Number of priors; each counts as one more sample."""
        return int(np.sum(np.asarray(self.residual.prior_weight) > 0))


def build_problem(records: Sequence[Record | Trace], request: Request) -> Problem:
    """Build the problem.

    Raises:
        UsageError: invalid names, bounds, priors or ties, or parameters that no trace can separate.
        DataError: a record from which the free parameters cannot be determined.
    """
    return problem_on(windows_of(records, request), request)


def windows_of(records: Sequence[Record | Trace], request: Request) -> tuple[Window, ...]:
    """Return the part of each record to which the law is fitted.

    Raises:
        UsageError: an unknown start or nuisance parameter.
        DataError: a record without the motion that the start requires.
    """
    law = request.oscillator.friction
    how = {"keeps_memory": law.n_states > 0, "creeps": law.kind == "smooth"}
    windows = [clear_of_jumps(open_window(record, request.start, request.nuisance, **how)) for record in records]
    # Doubts about the machine are reported once for all runs.
    doubts = (*windows[0].doubts, *contradiction(request.oscillator, windows[0].segmentation.half_period))
    return (dataclasses.replace(windows[0], doubts=doubts), *windows[1:])


def problem_on(windows: tuple[Window, ...], request: Request) -> Problem:
    """Return the problem for these windows; raise as `build_problem` does."""
    leaves = leaves_of(request.oscillator)
    shared, bracketed = shared_leaves(request, leaves)
    _check_windows(windows)
    parameters = free_parameters(request, shared, leaves, windows)
    names = [parameter.name for parameter in parameters]
    ties = [Tie(leaf.index, names.index(name), factor) for leaf, name, factor in tied(request.tie, leaves, names)]
    space = ParameterSpace.build(
        parameters, [leaf.index for leaf in shared], ties, [window.nuisances for window in windows]
    )
    residual, inputs = _residual(request, space, windows, parameters)
    condensed = _condensed(residual, windows)
    return Problem(
        residual=residual,
        condensed=condensed,
        stage_weights=tuple(stage_weights_of(window, run) for window, run in zip(windows, condensed.runs, strict=True)),
        limits=_limits(space, parameters),
        loss=request.loss,
        parameters=parameters,
        inputs=inputs,
        windows=windows,
        bracketed=bracketed,
        noise=request.noise,
        request=request,
    )


def with_rests(problem: Problem) -> Problem:
    """Return the problem with all samples of the rests.

    They include samples that repeat a rounding error.
    """
    windows = (dataclasses.replace(window, used=window.used | window.repeated) for window in problem.windows)
    return with_windows(problem, tuple(windows))


def with_windows(problem: Problem, windows: tuple[Window, ...]) -> Problem:
    """Return the problem with other samples or weights."""
    pairs = zip(windows, problem.residual.runs, strict=True)
    runs = tuple(full_run(window, True)._replace(half_cycles=run.half_cycles) for window, run in pairs)
    runs = tuple(run._replace(engine=old.engine) for run, old in zip(runs, problem.residual.runs, strict=True))
    residual = problem.residual._replace(runs=of_one_length(runs))
    condensed = _condensed(residual, windows)
    stage_weights = tuple(stage_weights_of(window, run) for window, run in zip(windows, condensed.runs, strict=True))
    return dataclasses.replace(
        problem, residual=residual, condensed=condensed, stage_weights=stage_weights, windows=windows
    )


def displaced(problem: Problem) -> Callable[[Sequence[np.ndarray]], Problem]:
    """Return a function that replaces the displacements of a problem.

    It takes one array [m] for each run, made from the model. Times, weights and windows do not change, so only
    displacements are condensed again.
    """
    pairs = zip(problem.windows, problem.residual.runs, strict=True)
    few = [condensation(window, run, problem.residual.oscillator) for window, run in pairs]

    def filled(residual: Residual, columns: Iterable[np.ndarray]) -> Residual:
        rows = zip(columns, residual.runs, strict=True)
        return residual.with_runs(x=[longer(values, run.t.size, values[-1]) for values, run in rows])

    def of(x: Sequence[np.ndarray]) -> Problem:
        residual = filled(problem.residual, x)
        condensed = filled(problem.condensed, map(Condensation.of, few, [run.x for run in residual.runs]))
        traces = (eqx.tree_at(lambda trace: trace.x, w.trace, each) for w, each in zip(problem.windows, x, strict=True))
        pairs = zip(problem.windows, traces, strict=True)
        windows = tuple(dataclasses.replace(window, trace=trace) for window, trace in pairs)
        return dataclasses.replace(problem, residual=residual, condensed=condensed, windows=windows, made=True)

    return of


def _check_windows(windows: Sequence[Window]) -> None:
    quantities = sorted({window.quantity for window in windows})
    if len(quantities) > 1:
        raise UsageError(
            f"One fit cannot join records in {' with records in '.join(quantities)}, because their residuals have no "
            "common unit. Fit them one by one."
        )
    for window, label in zip(windows, labels([window.name for window in windows]), strict=True):
        where = "" if len(windows) == 1 else f" of {label}"
        if window.used.sum() < 8:
            raise DataError(f"The fitted window{where} holds only {int(window.used.sum())} samples. Widen it.")
        if "offset" in window.nuisances and window.completed < 2:
            # Gaps may hide other half-cycles.
            faults = reported_faults(Record(window.trace, window.observation.meta), where)
            raise DataError(
                f"The fitted window{where} holds {window.completed} complete half-cycle(s), and with the offset free "
                "friction is undetermined from fewer than two. Release from farther away, start at the release, or fix "
                "the offset (nuisance= without 'offset')." + "".join(f" {fault}" for fault in faults.values())
            )


def _residual(
    request: Request,
    space: ParameterSpace,
    windows: Sequence[Window],
    parameters: Sequence[Parameter],
) -> tuple[Residual, dict[str, Measured]]:
    """Return the residual of all samples, and its rig inputs."""
    engine = engine_for(request, windows)
    mean, weight = parse_priors(request.priors, [parameter.name for parameter in parameters], windows)
    oscillator = jax.tree.map(lambda leaf: np.asarray(leaf, float), request.oscillator)
    runs = of_one_length(tuple(full_run(window, can_stop(request)) for window in windows))
    if isinstance(engine, Tables):
        runs = tuple(run._replace(engine=engine.of_run(w)) for run, w in zip(runs, windows, strict=True))
    inputs = rig_inputs(request.rig, oscillator, {*space.leaves, *(tie.leaf for tie in space.ties)})
    priors = np.asarray(mean), np.asarray(weight)
    return Residual(oscillator, space, engine, runs, *priors, inputs.changes, inputs.period), inputs.measured


def _condensed(residual: Residual, windows: Sequence[Window]) -> Residual:
    """Return the residual of condensed records, without rig inputs."""
    pairs = zip(windows, residual.runs, strict=True)
    runs = of_one_length(tuple(condensed_run(*pair, residual.oscillator) for pair in pairs))
    return without_inputs(residual)._replace(runs=runs)


def _limits(space: ParameterSpace, parameters: Sequence[Parameter]) -> Limits:
    lower, upper = space.coordinates(np.array([[p.lower for p in parameters], [p.upper for p in parameters]]))
    kinds = np.array([parameter.kind in LINEAR for parameter in parameters])
    return Limits(lower, upper, kinds & np.isneginf(lower) & np.isposinf(upper))


def engine_for(request: Request, windows: Sequence[Window]) -> AbstractEngine:
    """Return the engine, suited to the longest record and the lowest noise."""
    machine = request.oscillator
    uncertain = () if request.rig is None else request.rig.inputs()
    drag_moves = any(name.endswith("drag") for name in (*request.free, *uncertain))
    half_cycles = max(_half_cycles(window, can_stop(request)) for window in windows)
    # A free drag, or one that derivatives are taken by, has no fixed value.
    known = eqx.tree_at(lambda machine: machine.drag, machine, np.asarray(np.nan)) if drag_moves else machine
    if request.engine == "diffrax":
        raise UsageError("The diffrax engine is a reference for simulations. Fit with another one, such as auto.")
    try:
        engine = select_engine(request.engine, known, max_half_cycles=power(half_cycles + 2, _CAPACITY))
    except ValueError as error:
        raise UsageError(str(error)) from error
    # An engine object is used unchanged.
    if not isinstance(request.engine, str):
        return engine
    demands = _demands(windows)
    tuned = engine.tuned(machine, demands)
    by_tables = request.engine == "auto" and demands.from_rest and Tables.refusal(machine) is None
    return Tables(other=tuned) if by_tables else tuned


def _demands(windows: Sequence[Window]) -> Demands:
    return Demands(
        deflections=[_swings(window) for window in windows],
        accuracy=min(float(np.median(w.sigma)) / w.gain / np.sqrt(w.used.sum()) for w in windows),
        from_rest=not any("v0" in w.nuisances or w.guesses["v0"] != 0 for w in windows),
    )


def _swings(window: Window) -> np.ndarray:
    """Return the amplitudes that a table must cover.

    These are the starts of all half-cycles, except the last ones before a stop.
    """
    segmentation = window.segmentation
    later = segmentation.turning_times > window.t_start + segmentation.half_period / 4
    swings = np.abs(segmentation.turning_points[later] - equilibrium(segmentation))
    by_table = window.half_cycles - UNTABLED if window.half_cycles < NEVER else swings.size + 1
    return np.append(abs(window.guesses["x0"]), swings)[: max(by_table, 0)]


def can_stop(request: Request) -> bool:
    """Return True if the law, with positive coefficients, can hold the mass."""
    machine, kinds = request.oscillator, {name.rsplit(".", 1)[-1] for name in request.free}
    sticks = bool(kinds & {"mu", "mu_s", "normal_force"})
    return sticks or float(machine.friction.static_force(machine.normal_force)) > 0


def _half_cycles(window: Window, stops: bool) -> int:
    """Return the number of half-cycles that the engine must support."""
    if stops and window.half_cycles < NEVER:
        return window.half_cycles
    return int(1.3 * float(window.trace.duration) / window.segmentation.half_period) + 4
