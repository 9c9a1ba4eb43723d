"""What can be asked for by a name or a number, in one place and without a single import of weight.

The package checks by it, and the command line checks by it before it reads a record or imports JAX; so both refuse the
same things in the same words. Names of parameters are those of a model, see :mod:`fricjax.fitting.names`.
"""

import math
import numbers
from collections.abc import Sequence
from typing import Any

from .errors import UsageError, check_choice

ENGINES = ("auto", "exact", "hybrid", "smooth", "diffrax")
LOSSES: tuple[str, ...] = ("squares", "huber", "soft_l1", "cauchy")
CRITERIA = ("bic", "aicc", "held_out")
"""What a comparison ranks by."""


def check_criterion(criterion: str, held_out: bool) -> None:
    """Refuse a criterion that does not exist, or of which nothing is computed.

    Raises:
        UsageError: names those that there are.
    """
    check_choice("ranking by", criterion, CRITERIA)
    if criterion == "held_out" and not held_out:
        raise UsageError("There is no ranking by 'held_out' with held_out=False: leave it out, or rank by 'bic'.")


def check_different(names: Sequence[str]) -> None:
    """Refuse two candidates of one name.

    Raises:
        UsageError: names all of them.
    """
    if len(set(names)) < len(names):
        raise UsageError(f"The names {', '.join(names)} are not all different. Give each candidate its own.")


def check_scatter(mu_scatter: float) -> None:
    """Refuse a scatter of mu from run to run that no runs have.

    Raises:
        UsageError: one below zero, or of one or more.
    """
    if not 0 <= mu_scatter < 1:
        raise UsageError(f"mu_scatter is a relative standard deviation, zero or more and below 1, got {mu_scatter:g}.")


def check_bins(bins: Any) -> None:
    """Refuse a number of ranges of speed that makes no curve.

    Raises:
        UsageError: no whole number of at least two.
    """
    if not isinstance(bins, numbers.Integral) or bins < 2:
        raise UsageError(f"bins must be a whole number of at least 2, or limits in m/s, got {bins!r}.")


def check_sampling(rate: float, duration: float | None) -> None:
    """Refuse samples that nobody can take.

    Raises:
        UsageError: a rate [1/s] or a duration [s] that is no positive number; None is no duration yet.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise UsageError(f"The rate must be a positive number of samples per second, got {rate}.")
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise UsageError(f"The duration must be a positive number of seconds, got {duration}.")


def check_noise(noise: float) -> None:
    """Refuse noise of no size, with which everything would be known exactly.

    Raises:
        UsageError: no positive number.
    """
    if not noise > 0:
        raise UsageError(f"The noise must be a positive standard deviation in metres, got {noise}.")
