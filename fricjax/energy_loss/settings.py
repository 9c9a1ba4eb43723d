"""What a route can be asked for: checked before a record is read or JAX is imported."""

import numbers
from typing import Any

from ..errors import UsageError


def check_bins(bins: Any) -> None:
    """Refuse a number of ranges of speed that makes no curve.

    Raises:
        UsageError: no whole number of at least two.
    """
    if not isinstance(bins, numbers.Integral) or bins < 2:
        raise UsageError(f"bins must be a whole number of at least 2, or limits in m/s, got {bins!r}.")
