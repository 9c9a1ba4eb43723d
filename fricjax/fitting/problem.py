"""From what the user asked for to the problem that is solved: parameters with start values, and the residual."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data import Record, Trace
from ..data.errors import DataError, UsageError
from ..oscillator import Hybrid, Oscillator, Smooth
from ..oscillator.engines import AbstractEngine, Span
from ..oscillator.leaves import leaves_of
from ..oscillator.select import select_engine
from .breaks import condensed
from .climb import Limits, Terrain
from .condense import Samples
from .loss import AbstractLoss, Squares
from .parameters import Request, free_parameters, parse_priors, parse_ties, shared_leaves
from .residual import Residual, Run
from .space import LINEAR, Parameter, ParameterSpace
from .window import NEVER, Window, equilibrium, open_window

# The error of the smooth engine is some thirty times smaller than the accuracy that it is asked for.
_SLACK = 10.0
_FEW = 8
_IN_PHASE, _SMALLEST, _SHORTEST = 0.35, 0.02, 4.0


@dataclasses.dataclass(frozen=True)
class Problem:
    """A fit before it is solved.

    Attributes:
        residual: residual of all samples, with the inputs of the rig.
        condensed: the same of far fewer samples that say the same, without the inputs; what is solved.
        terrain: for each run what its windows need to know, at the condensed samples.
        limits: bounds in coordinates.
        loss: loss of the residuals.
        parameters: the free parameters in order.
        windows: the fitted part of each record.
        bracketed: name of a static coefficient that the user freed and that is bracketed instead of fitted.
    """

    residual: Residual
    condensed: Residual
    terrain: tuple[Terrain, ...]
    limits: Limits
    loss: AbstractLoss
    parameters: tuple[Parameter, ...]
    windows: tuple[Window, ...]
    bracketed: str | None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    def by_run(self, residual: Any) -> list[np.ndarray]:
        """The weighted residual of each run at the samples of its record, without those of the priors."""
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
        """Number of priors, each as good as one more sample."""
        return int(np.sum(np.asarray(self.residual.prior_weight) > 0))


def pose(records: Sequence[Record | Trace], request: Request) -> Problem:
    """Build the problem.

    Raises:
        UsageError: names, bounds, priors or ties that do not fit, or parameters that no trace can tell apart.
        DataError: a record from which the free parameters cannot be determined.
    """
    leaves = leaves_of(request.oscillator)
    shared, bracketed = shared_leaves(request, leaves)
    law = request.oscillator.friction
    creeps = not law.set_valued and not law.n_states
    windows = tuple(
        open_window(record, request.start, request.nuisance, keeps_memory=law.n_states > 0, creeps=creeps)
        for record in records
    )
    _check_windows(windows)
    parameters = free_parameters(request, shared, leaves, windows)
    names = [parameter.name for parameter in parameters]
    ties = parse_ties(request.tie, leaves, names)
    space = ParameterSpace.build(
        parameters, [leaf.index for leaf in shared], ties, [window.nuisances for window in windows]
    )
    residual = _residual(request, space, windows, parameters)
    condensed = _condensed(residual, windows, request.loss)
    return Problem(
        residual=residual,
        condensed=condensed,
        terrain=tuple(_terrain(window, run) for window, run in zip(windows, condensed.runs, strict=True)),
        limits=_limits(space, parameters),
        loss=request.loss,
        parameters=parameters,
        windows=windows,
        bracketed=bracketed,
    )


def _check_windows(windows: Sequence[Window]) -> None:
    for i, window in enumerate(windows):
        where = "" if len(windows) == 1 else f" of run {i}"
        if window.used.sum() < 8:
            raise DataError(f"The fitted window{where} holds only {int(window.used.sum())} samples. Widen it.")
        if "offset" in window.nuisances and window.strokes < 2:
            raise DataError(
                f"The fitted window{where} holds {window.strokes} complete half-cycle(s), and with the offset free "
                "friction is undetermined from fewer than two. Release from farther away, start at the release, or fix "
                "the offset (nuisance without 'offset')."
            )


def _residual(
    request: Request,
    space: ParameterSpace,
    windows: Sequence[Window],
    parameters: Sequence[Parameter],
) -> Residual:
    engine = _engine(request, windows)
    mean, weight = parse_priors(request.priors, [parameter.name for parameter in parameters], windows)
    oscillator = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), request.oscillator)
    runs = tuple(_run(window, _stops(request)) for window in windows)
    inputs = _inputs(request.rig, oscillator, {*space.leaves, *(tie.leaf for tie in space.ties)})
    return Residual(oscillator, space, engine, runs, jnp.asarray(mean), jnp.asarray(weight), inputs)


def _inputs(rig: Any, oscillator: Oscillator, free: set[int]) -> Float[Array, "inputs leaves"]:
    """Change of each leaf of the machine for one standard uncertainty of each uncertain input of the rig."""
    changes = [jnp.zeros((0, len(jax.tree.leaves(oscillator))))]
    if rig is None:
        return changes[0]
    for name, measured in rig.inputs().items():

        def machine(b: Array, name: str = name) -> Oscillator:
            return rig.with_inputs({name: b}).oscillator(oscillator.friction)

        at, by = jnp.asarray(float(measured.value)), jnp.asarray(float(measured.std))
        made, change = jax.jvp(machine, (at,), (by,))
        if jax.tree.structure(change) != jax.tree.structure(oscillator):
            raise UsageError(
                "The rig describes another machine than the oscillator. Build it with rig.oscillator(friction)."
            )
        changes.append(jnp.stack(jax.tree.leaves(change))[None])
        _check_same(name, made, oscillator, free)
    return jnp.concatenate(changes)


def _check_same(name: str, made: Oscillator, oscillator: Oscillator, free: set[int]) -> None:
    """Refuse a rig whose numbers are not those of the oscillator, where these are not fitted."""
    for leaf, ours, theirs in zip(leaves_of(oscillator), *map(jax.tree.leaves, (oscillator, made)), strict=True):
        if leaf.index not in free and not np.isclose(float(ours), float(theirs), rtol=1e-9, atol=0):
            raise UsageError(
                f"The rig gives {leaf.name} = {float(theirs):.9g}, but the oscillator has {float(ours):.9g}. Build it "
                "with rig.oscillator(friction)."
            )


def _engine(request: Request, windows: Sequence[Window]) -> AbstractEngine:
    """The engine, built for the longest record and for an error below what its noise leaves visible."""
    machine, drag_free = request.oscillator, any(name.endswith("drag") for name in request.free)
    strokes = max(_strokes(window, _stops(request)) for window in windows)
    name = "hybrid" if drag_free and request.engine == "auto" and machine.friction.set_valued else request.engine
    try:
        engine = select_engine(name, machine, max_half_cycles=max(16, 2 ** int(np.ceil(np.log2(strokes + 2)))))
    except ValueError as error:
        raise UsageError(str(error)) from error
    if drag_free and engine.__class__.__name__ == "Exact":
        raise UsageError("drag is free, and the exact engine has no drag. Use the hybrid engine.")
    return engine if isinstance(request.engine, AbstractEngine) else _tuned(engine, windows)


def _tuned(engine: AbstractEngine, windows: Sequence[Window]) -> AbstractEngine:
    """The engine with what the records tell: the accuracy that their noise asks for, or their range of amplitudes."""
    if isinstance(engine, Smooth):
        accuracy = _SLACK * min(float(np.median(w.sigma)) / np.sqrt(w.used.sum()) for w in windows)
        return eqx.tree_at(lambda e: e.accuracy, engine, np.asarray(accuracy))
    turning = [np.abs(w.segmentation.turning_points - equilibrium(w.segmentation)) for w in windows]
    if not isinstance(engine, Hybrid) or any(points.size < _FEW for points in turning):
        return engine
    lowest = 0.8 * min(float(points[:-1].min()) for points in turning)
    highest = 1.1 * max(max(abs(w.guesses["x0"]), float(p.max())) for w, p in zip(windows, turning, strict=True))
    amplitudes = 4 * int(np.ceil(1.5 + 1.5 * np.log(highest / lowest)))
    span = Span(np.asarray(lowest), np.asarray(highest))
    return Hybrid(engine.nodes, engine.max_half_cycles, span, int(np.clip(amplitudes, 8, 32)))


def _stops(request: Request) -> bool:
    """Whether the law can hold the mass, with the free coefficients away from zero."""
    machine, kinds = request.oscillator, {name.rsplit(".", 1)[-1] for name in request.free}
    holds = float(machine.friction.static_force(machine.normal_force)) > 0
    return holds or bool(kinds & {"mu", "mu_s", "normal_force"})


def _strokes(window: Window, stops: bool) -> int:
    """Half-cycles that the engine must provide for: those until the stop, or as many as the record can hold."""
    if stops and window.half_cycles < NEVER:
        return window.half_cycles
    return int(1.3 * float(window.trace.duration) / window.segmentation.half_period) + 4


def _run(window: Window, stops: bool) -> Run:
    used = np.flatnonzero(window.used)
    t = np.asarray(window.trace.t) - window.origin
    samples = Samples(
        t=np.clip(t, t[used[0]], t[used[-1]]),
        x=np.asarray(window.trace.x),
        weight=np.where(window.used, 1 / window.sigma, 0.0),
    )
    return Run(
        *_filled(samples, 8),
        half_cycles=np.asarray(window.half_cycles if stops else NEVER),
        fixed={name: np.asarray(value) for name, value in window.guesses.items()},
    )


def _condensed(residual: Residual, windows: Sequence[Window], loss: AbstractLoss) -> Residual:
    """The residual of the condensed records, without the inputs of the rig.

    Only squares can be condensed: another loss has to see each sample.
    """
    bare = eqx.tree_at(lambda r: r.inputs, residual, residual.inputs[:0])
    if not isinstance(loss, Squares):
        return bare
    runs = []
    for window, run in zip(windows, residual.runs, strict=True):
        few = _filled(condensed(window, Samples(run.t, run.x, run.weight), residual.oscillator), 4)
        runs.append(eqx.tree_at(lambda r: (r.t, r.x, r.weight), run, tuple(few)))
    return eqx.tree_at(lambda r: r.runs, bare, tuple(runs))


def _filled(samples: Samples, parts: int) -> Samples:
    """Samples without weight added at the end, up to a multiple of the last power of two over `parts`.

    So records of similar length share one compilation.
    """
    n = samples.t.size
    unit = max(2 ** (n - 1).bit_length() // parts, 1)
    missing = -n % unit
    t, x = (np.pad(values, (0, missing), mode="edge") for values in (samples.t, samples.x))
    return Samples(t, x, np.pad(samples.weight, (0, missing)))


def _terrain(window: Window, run: Run) -> Terrain:
    """Weights of a run without its rest, and how far from the record its motion may be to count as in phase."""
    found, t = window.segmentation, np.asarray(run.t)
    rest = np.inf if found.rest is None else found.rest - window.origin
    moving = np.where(t <= rest, run.weight, 0.0)
    local = np.full(t.shape, found.amplitude)
    if found.turning_times.size:
        swing = np.abs(found.turning_points - window.guesses["offset"])
        local = np.interp(t, found.turning_times - window.origin, swing)
    tolerance = _IN_PHASE * run.weight * np.maximum(local, _SMALLEST * found.amplitude)
    span = np.ptp(t[moving > 0])
    return Terrain(moving, tolerance, np.asarray(_SHORTEST * found.half_period / span))


def _limits(space: ParameterSpace, parameters: Sequence[Parameter]) -> Limits:
    lower, upper = (space.coordinates(np.array([getattr(p, end) for p in parameters])) for end in ("lower", "upper"))
    kinds = np.array([parameter.kind in LINEAR for parameter in parameters])
    return Limits(lower, upper, kinds & np.isneginf(lower) & np.isposinf(upper))
