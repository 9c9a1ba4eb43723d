"""What the fit of pairs can be asked for: checked before a record is read or JAX is imported."""

from ..errors import UsageError


def check_scatter(mu_scatter: float) -> None:
    """Refuse a scatter of mu from run to run that no runs have.

    Raises:
        UsageError: one below zero, or of one or more.
    """
    if not 0 <= mu_scatter < 1:
        raise UsageError(f"mu_scatter is a relative standard deviation, zero or more and below 1, got {mu_scatter:g}.")
