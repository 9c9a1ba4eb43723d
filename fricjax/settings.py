"""Checks of names and numbers that a user passes, without heavy imports.

The package and the command line share these checks, so both give the same messages. The command line runs them before
it reads a record or imports JAX. Parameter names belong to a model, see :mod:`fricjax.fitting.names`.
"""

import math
import numbers
from collections.abc import Sequence
from typing import Any

from .errors import UsageError, check_choice

ENGINES = ("auto", "exact", "hybrid", "smooth", "diffrax")
LOSSES: tuple[str, ...] = ("squares", "huber", "soft_l1", "cauchy")
CRITERIA = ("bic", "aicc", "held_out")
"""Criteria by which a comparison ranks laws."""


def check_criterion(criterion: str, held_out: bool) -> None:
    """Refuse a criterion that is unknown or will not be computed.

    Raises:
        UsageError: the criterion is unknown (the message lists the known ones), or it is "held_out" without `held_out`.
    """
    check_choice("ranking by", criterion, CRITERIA)
    if criterion == "held_out" and not held_out:
        raise UsageError("There is no ranking by 'held_out' with held_out=False: leave it out, or rank by 'bic'.")


def check_different(names: Sequence[str]) -> None:
    """Refuse two candidates with the same name.

    Raises:
        UsageError: two names are equal; the message lists all names.
    """
    if len(set(names)) < len(names):
        raise UsageError(f"The names {', '.join(names)} are not all different. Give each candidate its own.")


def check_scatter(mu_scatter: float) -> None:
    """Refuse an impossible scatter of mu from run to run.

    Raises:
        UsageError: the scatter is negative, or one or more.
    """
    if not 0 <= mu_scatter < 1:
        raise UsageError(f"mu_scatter is a relative standard deviation, zero or more and below 1, got {mu_scatter:g}.")


def check_bins(bins: Any) -> None:
    """Refuse an invalid number of speed bins.

    Raises:
        UsageError: `bins` is not an integer of at least two.
    """
    if not isinstance(bins, numbers.Integral) or bins < 2:
        raise UsageError(f"bins must be a whole number of at least 2, or limits in m/s, got {bins!r}.")


def check_sampling(rate: float, duration: float | None) -> None:
    """Refuse an invalid sampling rate or duration.

    Raises:
        UsageError: the rate [1/s] or the duration [s] is not a positive number. A duration of None is not checked.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise UsageError(f"The rate must be a positive number of samples per second, got {rate}.")
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise UsageError(f"The duration must be a positive number of seconds, got {duration}.")


def check_noise(noise: float) -> None:
    """Refuse a standard deviation of the noise that is not positive.

    Raises:
        UsageError: the noise is not a positive number.
    """
    if not noise > 0:
        raise UsageError(f"The noise must be a positive standard deviation in metres, got {noise}.")
