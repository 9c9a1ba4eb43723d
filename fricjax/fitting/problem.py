"""From what the user asked for to the problem that is solved: parameters with start values, and the residual."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data import Record, Trace
from ..data.errors import DataError, UsageError
from ..oscillator import Oscillator, Smooth
from ..oscillator.engines import AbstractEngine
from ..oscillator.select import select_engine
from .guess import guess_machine
from .names import NUISANCES, Leaf, check_identifiable, check_names, find_leaf, leaves_of, sole_coulomb
from .residual import Residual, Run
from .space import NOT_NEGATIVE, Parameter, ParameterSpace, Tie
from .window import NEVER, Window, open_window


@dataclasses.dataclass(frozen=True)
class Problem:
    """A fit before it is solved.

    Attributes:
        residual: residual with all used samples in its weights.
        moving: for each run the weights without the rest.
        parameters: the free parameters in order.
        windows: the fitted part of each record.
        lower, upper: bounds in coordinates.
        bracketed: name of a static coefficient that the user freed and that is bracketed instead of fitted.
    """

    residual: Residual
    moving: tuple[Any, ...]
    parameters: tuple[Parameter, ...]
    windows: tuple[Window, ...]
    lower: Any
    upper: Any
    bracketed: str | None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def n_used(self) -> int:
        """Number of fitted samples."""
        return int(sum(window.used.sum() for window in self.windows))

    @property
    def n_priors(self) -> int:
        """Number of priors, each as good as one more sample."""
        return int(np.sum(np.asarray(self.residual.prior_weight) > 0))


@dataclasses.dataclass(frozen=True)
class Request:
    """What the caller of a fit asked for, as given."""

    oscillator: Oscillator
    free: tuple[str, ...]
    nuisance: tuple[str, ...] | None
    engine: str | AbstractEngine
    start: str | float
    bounds: Mapping[str, tuple[float | None, float | None]]
    priors: Mapping[str, Any]
    tie: Mapping[str, Any]
    rig: Any


def pose(records: Sequence[Record | Trace], request: Request) -> Problem:
    """Build the problem.

    Raises:
        UsageError: names, bounds, priors or ties that do not fit, or parameters that no trace can tell apart.
        DataError: a record from which the free parameters cannot be determined.
    """
    leaves = leaves_of(request.oscillator)
    shared, bracketed = _shared(request, leaves)
    law = request.oscillator.friction
    creeps = not law.set_valued and not law.n_states
    windows = tuple(
        open_window(record, request.start, request.nuisance, keeps_memory=law.n_states > 0, creeps=creeps)
        for record in records
    )
    _check_windows(windows)
    parameters = _parameters(request, shared, leaves, windows)
    names = [parameter.name for parameter in parameters]
    ties = _ties(request.tie, leaves, names)
    space = ParameterSpace.build(
        parameters, [leaf.index for leaf in shared], ties, [window.nuisances for window in windows]
    )
    residual = _residual(request, space, windows, parameters)
    return Problem(
        residual=residual,
        moving=tuple(_weights(window, window.moving) for window in windows),
        parameters=parameters,
        windows=windows,
        lower=space.coordinates(jnp.asarray([p.lower for p in parameters])),
        upper=space.coordinates(jnp.asarray([p.upper for p in parameters])),
        bracketed=bracketed,
    )


def _shared(request: Request, leaves: Sequence[Leaf]) -> tuple[list[Leaf], str | None]:
    """The free leaves, without the static coefficient of a Coulomb law, which has no gradient."""
    if not request.free:
        raise UsageError(f"Nothing is free. Name at least one of {', '.join(leaf.name for leaf in leaves)}.")
    found = [find_leaf(name, leaves) for name in request.free]
    if len(set(found)) < len(found):
        raise UsageError(f"A parameter is named twice in free={list(request.free)}.")
    check_identifiable([leaf.name for leaf in found], leaves)
    bracketable = sole_coulomb(request.oscillator.friction) is not None
    static = [leaf for leaf in found if bracketable and leaf.dotted.endswith("mu_s")]
    kept = [leaf for leaf in found if leaf not in static]
    if not kept:
        raise UsageError("mu_s of a Coulomb law is bracketed from stops, not fitted. Free mu as well.")
    return kept, static[0].name if static else None


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


def _parameters(
    request: Request, shared: Sequence[Leaf], leaves: Sequence[Leaf], windows: Sequence[Window]
) -> tuple[Parameter, ...]:
    flat = [float(value) for value in jax.tree.leaves(request.oscillator)]
    values = {leaf.name.rsplit(".", 1)[-1]: flat[leaf.index] for leaf in reversed(leaves)}
    kinds = [leaf.name.rsplit(".", 1)[-1] for leaf in shared]
    guessed = guess_machine(request.oscillator, [w.segmentation for w in windows], kinds, values)
    entries: list[tuple[str, str, float, float]] = []
    for leaf, kind in zip(shared, kinds, strict=True):
        start = guessed.get(kind, flat[leaf.index])
        if kind == "mu_s" and "mu" in guessed and values["mu"] > 0:
            start *= guessed["mu"] / values["mu"]
        entries.append((leaf.name, leaf.unit, start, _scale(kind, start, {**values, **guessed})))
    for i, window in enumerate(windows):
        suffix = "" if len(windows) == 1 else f"[{i}]"
        sizes = _run_scales(window)
        entries += [(f"{n}{suffix}", NUISANCES[n], window.guesses[n], sizes[n]) for n in window.nuisances]
    check_names(request.bounds, [entry[0] for entry in entries], "Bounds")
    return tuple(_bounded(*entry, request.bounds, _origin(entry[0], windows)) for entry in entries)


def _origin(name: str, windows: Sequence[Window]) -> float:
    """What separates the time of the record, in which callers speak of release times, from that of the run [s]."""
    if not name.startswith("t_release"):
        return 0.0
    return windows[int(name[len("t_release[") : -1] or 0)].origin


def _scale(kind: str, start: float, values: Mapping[str, float]) -> float:
    """Typical size of a shared parameter, for those that may be zero."""
    critical = 2 * np.sqrt(values["stiffness"] * values["mass"])
    fallback = {"damping": 1e-3 * critical, "sigma1": 1e-3 * critical, "sigma2": 1e-3 * critical, "mu": 1e-3}
    return abs(start) if start != 0 else fallback.get(kind, 1.0)


def _run_scales(window: Window) -> dict[str, float]:
    amplitude, half_period = window.segmentation.amplitude, window.segmentation.half_period
    speed = amplitude * np.pi / half_period
    sizes = {"x0": amplitude, "offset": amplitude, "v0": speed, "t_release": half_period}
    return {**sizes, "drift": 1e-3 * speed}


def _bounded(name: str, unit: str, start: float, scale: float, bounds: Mapping[str, tuple], origin: float) -> Parameter:
    kind = name.rsplit(".", 1)[-1]
    default = (0.0 if kind in NOT_NEGATIVE else None, None)
    low, high = _pair(bounds.get(name, default), f"The bounds of {name} must be a lower and an upper value or None")
    lower = -np.inf if low is None else float(low) - origin
    upper = np.inf if high is None else float(high) - origin
    if not lower < upper:
        raise UsageError(f"The bounds of {name} must be a lower and a larger upper value, got {low} and {high}.")
    start = min(max(start, lower), upper)
    return Parameter(name, unit, start, scale, lower, upper)


def _pair(given: Any, demand: str) -> tuple[Any, Any]:
    try:
        first, second = given
    except (TypeError, ValueError) as error:
        raise UsageError(f"{demand}, got {given!r}.") from error
    return first, second


def _ties(tie: Mapping[str, Any], leaves: Sequence[Leaf], names: Sequence[str]) -> list[Tie]:
    ties = []
    for target, source in tie.items():
        leaf = find_leaf(target, leaves)
        name, factor = source if isinstance(source, tuple | list) else (source, 1.0)
        if leaf.name in names:
            raise UsageError(f"{target} is tied to {name} and cannot be free as well. Take it out of free.")
        check_names({name: None}, names, "Ties")
        ties.append(Tie(leaf.index, names.index(name), float(factor)))
    return ties


def _residual(
    request: Request,
    space: ParameterSpace,
    windows: Sequence[Window],
    parameters: Sequence[Parameter],
) -> Residual:
    engine = _engine(request, windows)
    mean, weight = _priors(request.priors, [parameter.name for parameter in parameters], windows)
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
    if isinstance(engine, Smooth) and not isinstance(request.engine, AbstractEngine):
        accuracy = min(float(np.median(w.sigma)) / np.sqrt(w.used.sum()) for w in windows)
        engine = eqx.tree_at(lambda e: e.accuracy, engine, jnp.asarray(accuracy))
    return engine


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


def _priors(
    priors: Mapping[str, Any], names: Sequence[str], windows: Sequence[Window]
) -> tuple[list[float], list[float]]:
    check_names(priors, names, "Priors")
    mean, weight = [0.0] * len(names), [0.0] * len(names)
    for name, prior in priors.items():
        pair = (prior.value, prior.std) if hasattr(prior, "value") and hasattr(prior, "std") else prior
        value, std = _pair(pair, f"The prior of {name} must be a mean and a standard deviation")
        if not std > 0:
            raise UsageError(f"The prior of {name} needs a positive standard deviation, got {std}.")
        i = names.index(name)
        mean[i], weight[i] = float(value) - _origin(name, windows), 1 / float(std)
    return mean, weight


def _run(window: Window, stops: bool) -> Run:
    used = np.flatnonzero(window.used)
    t = np.asarray(window.trace.t) - window.origin
    t = np.clip(t, t[used[0]], t[used[-1]])
    return Run(
        t=jnp.asarray(t),
        x=jnp.asarray(window.trace.x),
        weight=jnp.asarray(_weights(window, window.used)),
        half_cycles=jnp.asarray(window.half_cycles if stops else NEVER),
        fixed={name: jnp.asarray(value) for name, value in window.guesses.items()},
    )


def _weights(window: Window, used: np.ndarray) -> np.ndarray:
    return np.where(used, 1 / window.sigma, 0.0)
