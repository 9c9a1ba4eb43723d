"""Free parameters of a fit: start values, scales, bounds, ties and priors."""

import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence
from numbers import Real
from typing import Any, NamedTuple, TypedDict, Unpack

import jax
import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError, check_choice, check_type, nearest
from ..estimation.loss import AbstractLoss, named_loss
from ..estimation.space import Parameter
from ..friction.coefficient import Coefficient
from ..oscillator import Oscillator
from ..oscillator.engines import AbstractEngine
from ..oscillator.oscillator import Leaf
from ..rig import Measured, Rig
from .guess import guess_machine
from .interchange import asked_of
from .law_start import guess_law, highest_of, terms_of
from .names import NUISANCES, check_names, chosen, sole_coulomb
from .settings import NOISE_MODELS, check_bounds, run_names
from .window import Window

type Prior = Measured | tuple[float, float]
type Free = Sequence[str] | Mapping[str, Any]
type Tied = str | tuple[str, float]


class RunSettings(TypedDict, total=False):
    """Settings of a fit to one run or to each of many.

    :func:`fricjax.fit` describes them.
    """

    t: ArrayLike | None
    rate: float | None
    nuisance: Sequence[str] | None
    engine: str | AbstractEngine
    start: str | float
    bounds: Mapping[str, tuple[float | None, float | None]] | None
    priors: Mapping[str, Prior] | None
    tie: Mapping[str, Tied] | None
    rig: Rig | None
    loss: str | AbstractLoss
    noise: str


class Settings(RunSettings, total=False):
    """All settings of a fit, for functions that pass them on."""

    sigma_mode: str
    guess: Mapping[str, float] | None
    throw: bool


def check_known(what: str, settings: Mapping[str, Any], known: Collection[str]) -> None:
    """Refuse settings that a function does not pass on to a fit.

    Raises:
        UsageError: names the nearest setting, and all others.
    """
    for name in settings:
        if name not in known:
            raise UsageError(f"{what} has no setting {name!r}.{nearest(name, known)} It has {', '.join(known)}.")


@dataclasses.dataclass(frozen=True)
class Request:
    """Arguments of a fit, after conversion."""

    oscillator: Oscillator
    free: tuple[str, ...]
    nuisance: tuple[str, ...] | None
    engine: str | AbstractEngine
    start: str | float
    bounds: Mapping[str, tuple[float | None, float | None]]
    priors: Mapping[str, Prior]
    tie: Mapping[str, Tied]
    rig: Rig | None
    guess: Mapping[str, float]
    loss: AbstractLoss
    noise: str = "auto"

    @classmethod
    def of(cls, oscillator: Oscillator, free: str | Free, **settings: Unpack[Settings]) -> "Request":
        """Build a request from keyword arguments, with the defaults of a fit.

        Raises:
            UsageError: no oscillator, no rig, or an unknown loss or noise.
        """
        noise = settings.get("noise", "auto")
        check_choice("noise model", noise, NOISE_MODELS)
        if not isinstance(oscillator, Oscillator):
            name = type(oscillator).__name__
            raise UsageError(f"fit needs an Oscillator, got {name}. Build one, or take rig.oscillator(friction).")
        for name in ("bounds", "priors", "tie", "guess"):
            check_type(name, settings.get(name), Mapping | None, "a mapping from the names of parameters")
        check_type("nuisance", settings.get("nuisance"), str | list | tuple | None, "a list of names")
        check_type("start", settings.get("start", ""), str | Real, "a name or a time in s")
        oscillator, free, asked = asked_of(free, oscillator, settings)
        nuisance, rig = settings.get("nuisance"), settings.get("rig")
        if not isinstance(rig, Rig | None):
            raise UsageError(f"rig must be a fricjax.Rig, got {type(rig).__name__}. Read one with Rig.from_toml(path).")
        return cls(
            oscillator=oscillator,
            free=(free,) if isinstance(free, str) else tuple(free),
            nuisance=None if nuisance is None else tuple(nuisance),
            engine=settings.get("engine", "auto"),
            start=settings.get("start", "first_reversal"),
            bounds=asked.get("bounds") or {},
            priors=settings.get("priors") or {},
            tie=settings.get("tie") or {},
            rig=rig,
            guess=asked.get("guess") or {},
            loss=named_loss(settings.get("loss", "squares")),
            noise=noise,
        )

    def with_guess(self, guess: Mapping[str, float]) -> "Request":
        """The same request with other start values."""
        return dataclasses.replace(self, guess=guess)


def shared_leaves(request: Request, leaves: Sequence[Leaf]) -> tuple[list[Leaf], str | None]:
    """Return the free leaves, without a bracketed static coefficient, and its name."""
    return chosen(request.free, leaves, sole_coulomb(request.oscillator.friction) is not None)


class _Entry(NamedTuple):
    """A free parameter before its bounds are known.

    It has a name, the properties of its kind, a start value and a typical size.
    """

    name: str
    known: Coefficient
    start: float
    scale: float


def free_parameters(
    request: Request, shared: Sequence[Leaf], leaves: Sequence[Leaf], windows: Sequence[Window]
) -> tuple[Parameter, ...]:
    """Return the free parameters with start values and bounds.

    Shared coefficients come first, then those of each run.
    """
    entries = [*_shared_entries(request, shared, leaves, windows), *_run_entries(windows)]
    names = [entry.name for entry in entries]
    check_names(request.bounds, names, "Bounds")
    check_names(request.guess, names, "Start values")
    entries = [entry._replace(start=_start_of(request, entry, windows)) for entry in entries]
    highest = _highest(request, shared, leaves, windows, entries)
    return tuple(
        _bounded(entry, highest.get(entry.name, np.inf), request.bounds, _origin(entry.name, windows))
        for entry in entries
    )


def _shared_entries(
    request: Request, shared: Sequence[Leaf], leaves: Sequence[Leaf], windows: Sequence[Window]
) -> list[_Entry]:
    """Return shared coefficients with start values from records, if possible."""
    flat = [float(value) for value in jax.tree.leaves(request.oscillator)]
    values = {leaf.kind: flat[leaf.index] for leaf in reversed(leaves)}
    kinds = [leaf.kind for leaf in shared]
    sought = any(leaf.name not in request.guess for leaf in shared)
    seen = windows if sought else []
    decays = [window.segmentation for window in seen]
    lower = {leaf.kind: _lower(request.bounds.get(leaf.name), leaf.name) for leaf in shared}
    sought_kinds = [*kinds, *terms_of(request.oscillator, leaves, shared)]
    guessed = guess_machine(request.oscillator, decays, sought_kinds, values, lower)
    of_law = guess_law(request.oscillator, leaves, shared, seen, {**values, **guessed})
    entries = []
    for leaf, kind in zip(shared, kinds, strict=True):
        start = of_law.get(leaf.name, guessed.get(kind, flat[leaf.index]))
        if leaf.name not in of_law and kind == "mu_s" and "mu" in guessed and values["mu"] > 0:
            start *= guessed["mu"] / values["mu"]
        entries.append(_Entry(leaf.name, leaf.coefficient, start, _scale(kind, start, {**values, **guessed})))
    return entries


def _lower(bounds: Any, name: str) -> float:
    """Return the lower one of a pair of bounds, else minus infinity."""
    low = (
        None if bounds is None else _pair(bounds, f"The bounds of {name} must be a lower and an upper value or None")[0]
    )
    return -np.inf if low is None else float(low)


def _run_entries(windows: Sequence[Window]) -> Iterator[_Entry]:
    """Yield the parameters of each run."""
    for i, window in enumerate(windows):
        sizes = _run_scales(window)
        for name, called in zip(window.nuisances, run_names(window.nuisances, i, len(windows)), strict=True):
            known = Coefficient(NUISANCES[name], "")
            yield _Entry(called, known, window.guesses[name], sizes[name])


def _highest(
    request: Request,
    shared: Sequence[Leaf],
    leaves: Sequence[Leaf],
    windows: Sequence[Window],
    entries: Sequence[_Entry],
) -> dict[str, float]:
    """Return the largest values that the records can resolve."""
    flat = jax.tree.leaves(request.oscillator)
    for leaf, entry in zip(shared, entries, strict=False):
        flat[leaf.index] = entry.start
    begun = jax.tree.unflatten(jax.tree.structure(request.oscillator), flat)
    return highest_of(begun, leaves, shared, windows)


def _start_of(request: Request, entry: _Entry, windows: Sequence[Window]) -> float:
    """Return the start value, from `guess` if given, in the run's time.

    Raises:
        UsageError: it is not finite, or not positive if the fit uses its logarithm or another transform.
    """
    name, positive = entry.name, entry.known.fitted_as != "value"
    if name not in request.guess:
        return entry.start
    value = float(request.guess[name])
    if not np.isfinite(value) or (positive and value <= 0):
        raise UsageError(
            f"The start value of {name} must be a finite {'positive ' if positive else ''}number, got {value:g}."
        )
    return value - _origin(name, windows)


def _origin(name: str, windows: Sequence[Window]) -> float:
    """Return the time offset from record to run for release times [s]."""
    if not name.startswith("t_release"):
        return 0.0
    return windows[int(name[len("t_release[") : -1] or 0)].origin


def _scale(kind: str, start: float, values: Mapping[str, float]) -> float:
    """Return the typical size of a shared parameter, never zero."""
    critical = 2 * np.sqrt(values["stiffness"] * values["mass"])
    fallback = {"damping": 1e-3 * critical, "sigma1": 1e-3 * critical, "sigma2": 1e-3 * critical, "mu": 1e-3}
    return abs(start) if start != 0 else fallback.get(kind, 1.0)


def _run_scales(window: Window) -> dict[str, float]:
    amplitude, half_period = window.segmentation.amplitude, window.segmentation.half_period
    speed = amplitude * np.pi / half_period
    sizes = {"x0": amplitude, "offset": window.gain * amplitude, "v0": speed, "t_release": half_period}
    return {**sizes, "drift": 1e-3 * window.gain * speed, "z0": 1.0}


def _bounded(entry: _Entry, rigid: float, bounds: Mapping[str, tuple], origin: float) -> Parameter:
    name, known, start, scale = entry
    # A coefficient that is fitted by its logarithm or inverse root never reaches zero.
    default = (known.lower if known.fitted_as == "value" else None, min(known.upper, rigid))
    low, high = _pair(bounds.get(name, default), f"The bounds of {name} must be a lower and an upper value or None")
    check_bounds(name, low, high)
    lower = -np.inf if low is None else float(low) - origin
    upper = np.inf if high is None else float(high) - origin
    start = min(max(start, lower), upper)
    return Parameter(name, known.unit, start, scale, lower, upper, known.fitted_as, rigid)


def _pair(value: Any, demand: str) -> tuple[Any, Any]:
    try:
        first, second = value
    except (TypeError, ValueError) as error:
        raise UsageError(f"{demand}, got {value!r}.") from error
    return first, second


def parse_priors(
    priors: Mapping[str, Prior], names: Sequence[str], windows: Sequence[Window]
) -> tuple[list[float], list[float]]:
    """Return mean and inverse standard deviation of each parameter's prior.

    The latter is zero without a prior.

    Raises:
        UsageError: a prior for a parameter that is not free, or without a positive standard deviation.
    """
    check_names(priors, names, "Priors")
    mean, weight = [0.0] * len(names), [0.0] * len(names)
    for name, prior in priors.items():
        pair = (prior.value, prior.std) if isinstance(prior, Measured) else prior
        value, std = _pair(pair, f"The prior of {name} must be a mean and a standard deviation")
        if not std > 0:
            raise UsageError(f"The prior of {name} needs a positive standard deviation, got {std}.")
        if not np.isfinite(value):
            raise UsageError(f"The prior of {name} needs a finite mean, got {value}.")
        i = names.index(name)
        mean[i], weight[i] = float(value) - _origin(name, windows), 1 / float(std)
    return mean, weight
