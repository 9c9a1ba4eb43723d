"""What a fit can be asked for: checked by name alone, before a record is read or JAX is imported."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import UsageError, check_choice, nearest
from ..settings import LOSSES
from .names import NUISANCES, Named, check_names, chosen, tied

STARTS = ("first_reversal", "release")
SIGMA_MODES = ("absolute", "scale", "estimate")
NOISE_MODELS = {
    "auto": "whichever of these the record shows",
    "white": "independent samples of one size",
    "jitter": "independent, from a clock that jitters, where that shows",
    "autoregressive": "a process that remembers, of the order that the residuals show",
    "coloured": "such a process beside the drift, hum and rounding that the residuals show",
    "floor": "motion of the mass, shaken by the floor, beside independent noise of the reading",
}
"""Names of the noise models, and what each takes the noise for."""
_NUISANCES = {
    "first_reversal": ("t_release", "x0", "offset"),
    "release": ("x0", "offset"),
    "seconds": ("x0", "v0", "offset"),
}


class Model(NamedTuple):
    """A model as far as its names go.

    Attributes:
        leaves: its coefficients.
        bracketable: whether its static coefficient is bracketed from stops, as that of Coulomb's law.
        keeps_memory: whether its law has internal states.
    """

    leaves: Sequence[Named]
    bracketable: bool
    keeps_memory: bool


def check_settings(model: Model, free: Sequence[str], runs: int, settings: Mapping[str, Any]) -> None:
    """Refuse names and settings of a fit that do not fit, as the fit itself would.

    Args:
        model: what is fitted.
        free: names of the free coefficients.
        runs: number of records.
        settings: the keywords of `fricjax.fit` that are checked: `nuisance`, `start`, `bounds`, `priors`, `tie`,
            `sigma_mode`, `guess`, `loss` and `noise`.

    Raises:
        UsageError: as `fricjax.fit` words it.
    """
    check_choice("sigma_mode", settings["sigma_mode"], SIGMA_MODES)
    check_choice("loss", settings["loss"], LOSSES)
    check_choice("noise model", settings.get("noise", "auto"), NOISE_MODELS)
    start = settings["start"]
    if isinstance(start, str):
        check_start(start)
    nuisances = nuisances_of(start if isinstance(start, str) else "seconds", settings["nuisance"], model.keeps_memory)
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
    """Refuse a start that has no name.

    Raises:
        UsageError: offers the nearest one and the `choices`.
    """
    if start not in STARTS:
        raise UsageError(f"There is no start {start!r}.{nearest(start, STARTS)} Choose {choices}.")


def nuisances_of(mode: str, chosen: Iterable[str] | None, keeps_memory: bool) -> tuple[str, ...]:
    """Names of a run's own parameters.

    Args:
        mode: "first_reversal", "release" or "seconds".
        chosen: names that the caller chose, or None for those that belong to the mode.
        keeps_memory: whether the law has internal states; it is then fitted from the middle of a half-cycle.

    Raises:
        UsageError: an unknown name, or two that cannot be separated.
    """
    mode = "seconds" if mode == "first_reversal" and keeps_memory else mode
    names = _NUISANCES[mode] if chosen is None else tuple(chosen)
    for name in names:
        check_nuisance(name)
    if "v0" in names and "t_release" in names:
        raise UsageError("v0 and t_release cannot both be free: each shifts the motion in time. Leave one of them out.")
    if "z0" in names and not keeps_memory:
        raise UsageError("z0 is the start of a law's internal state, and this law has none. Leave it out of nuisance=.")
    return names


def check_nuisance(name: str) -> None:
    """Refuse the name of a parameter that no run has.

    Raises:
        UsageError: offers the nearest one.
    """
    if name not in NUISANCES:
        raise UsageError(
            f"There is no nuisance parameter {name!r}.{nearest(name, NUISANCES)} Known are {', '.join(NUISANCES)}."
        )


def check_once(names: Sequence[str]) -> None:
    """Refuse a parameter that is named twice.

    Raises:
        UsageError: names it.
    """
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise UsageError(f"{twice[0]} is named twice. Name it once.")


def run_names(nuisances: Iterable[str], run: int, runs: int) -> list[str]:
    """Names of a run's own parameters among those of several runs."""
    return [name if runs == 1 else f"{name}[{run}]" for name in nuisances]


def check_bounds(name: str, low: float | None, high: float | None) -> None:
    """Refuse bounds between which nothing lies; None is no bound.

    Raises:
        UsageError: names both.
    """
    if low is not None and high is not None and not low < high:
        raise UsageError(f"The bounds of {name} must be a lower and a larger upper value, got {low} and {high}.")
