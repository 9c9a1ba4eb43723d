"""Settings of a fit, checked before records or JAX are loaded."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import UsageError, check_choice, nearest
from ..settings import LOSSES
from .names import NUISANCES, Named, check_names, chosen, tied

STARTS = ("first_reversal", "release")
SIGMA_MODES = ("absolute", "scale", "estimate")
NOISE_MODELS = {
    "auto": "selected from the record",
    "white": "independent samples of equal variance",
    "jitter": "independent samples with timing jitter of the clock, if significant",
    "autoregressive": "a correlated process; the residuals determine its order",
    "coloured": "a correlated process, with drift, hum and rounding if significant",
    "floor": "floor vibration that moves the mass, and independent noise of the reading",
}
"""Names of the noise models, each with a description."""
_NUISANCES = {
    "first_reversal": ("t_release", "x0", "offset"),
    "release": ("x0", "offset"),
    "seconds": ("x0", "v0", "offset"),
}


class Model(NamedTuple):
    """Names and properties of a model.

    Attributes:
        leaves: its coefficients.
        bracketable: True if its static coefficient is bracketed from stops, like that of Coulomb's law.
        keeps_memory: True if its law has internal states.
    """

    leaves: Sequence[Named]
    bracketable: bool
    keeps_memory: bool


def check_settings(model: Model, free: Sequence[str], runs: int, settings: Mapping[str, Any]) -> None:
    """Refuse invalid names and settings, as the fit would do.

    Args:
        model: the model to fit.
        free: names of the free coefficients.
        runs: number of records.
        settings: the checked keywords of `fricjax.fit`: `nuisance`, `start`, `bounds`, `priors`, `tie`, `sigma_mode`,
            `guess`, `loss` and `noise`.

    Raises:
        UsageError: with the message of `fricjax.fit`.
    """
    check_choice("sigma_mode", settings["sigma_mode"], SIGMA_MODES)
    check_choice("loss", settings["loss"], LOSSES)
    check_choice("noise model", settings.get("noise", "auto"), NOISE_MODELS)
    start = settings["start"]
    if isinstance(start, str):
        check_start(start)
    # The record may be a velocity, which has a drift by default.
    named = [name.split("[")[0] for key in ("bounds", "guess", "priors") for name in settings[key]]
    mode = start if isinstance(start, str) else "seconds"
    nuisances = nuisances_of(mode, settings["nuisance"], model.keeps_memory, drifts="drift" in named)
    kept, _ = chosen(free, model.leaves, model.bracketable)
    names = [leaf.name for leaf in kept] + [name for run in range(runs) for name in run_names(nuisances, run, runs)]
    check_names(settings["bounds"], names, "Bounds")
    for name, (low, high) in settings["bounds"].items():
        check_bounds(name, low, high)
    check_names(settings["guess"], names, "Start values")
    check_names(settings["priors"], names, "Priors")
    tied(settings["tie"], model.leaves, names)


def check_start(
    start: str, choices: str = "first_reversal, release or a number of seconds from the first sample"
) -> None:
    """Refuse an unknown start.

    Raises:
        UsageError: the message names the nearest one and the `choices`.
    """
    if start not in STARTS:
        raise UsageError(f"There is no start {start!r}.{nearest(start, STARTS)} Choose {choices}.")


def nuisances_of(mode: str, chosen: Iterable[str] | None, keeps_memory: bool, drifts: bool = False) -> tuple[str, ...]:
    """Return the names of a run's parameters.

    Args:
        mode: "first_reversal", "release" or "seconds".
        chosen: names from the caller, or None for the default of the mode.
        keeps_memory: True if the law has internal states; it is then fitted from the middle of a half-cycle.
        drifts: True for a velocity or an acceleration, because their sensors drift.

    Raises:
        UsageError: an unknown name, or two that cannot be separated.
    """
    mode = "seconds" if mode == "first_reversal" and keeps_memory else mode
    names = (*_NUISANCES[mode], *(("drift",) if drifts else ())) if chosen is None else tuple(chosen)
    check_once(names)
    for name in names:
        check_nuisance(name)
    if "v0" in names and "t_release" in names:
        raise UsageError("v0 and t_release cannot both be free: each shifts the motion in time. Leave one of them out.")
    if "z0" in names and not keeps_memory:
        raise UsageError("z0 is the start of a law's internal state, and this law has none. Leave it out of nuisance=.")
    return names


def check_nuisance(name: str) -> None:
    """Refuse an unknown parameter of a run.

    Raises:
        UsageError: the message names the nearest one.
    """
    if name not in NUISANCES:
        raise UsageError(
            f"There is no nuisance parameter {name!r}.{nearest(name, NUISANCES)} Known are {', '.join(NUISANCES)}."
        )


def check_once(names: Sequence[str]) -> None:
    """Refuse a repeated parameter name.

    Raises:
        UsageError: the message names it.
    """
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise UsageError(f"{twice[0]} is named twice. Name it once.")


def run_names(nuisances: Iterable[str], run: int, runs: int) -> list[str]:
    """Return the names of one run's parameters among several runs."""
    return [name if runs == 1 else f"{name}[{run}]" for name in nuisances]


def check_bounds(name: str, low: float | None, high: float | None) -> None:
    """Refuse bounds that contain no value; None means no bound.

    Raises:
        UsageError: the message names both.
    """
    if low is not None and high is not None and not low < high:
        raise UsageError(f"The bounds of {name} must be a lower and a larger upper value, got {low} and {high}.")
