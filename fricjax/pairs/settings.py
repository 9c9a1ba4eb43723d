"""What a route can be asked for: checked before a record is read or JAX is imported."""

import numbers
from typing import Any

from ..errors import UsageError


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
