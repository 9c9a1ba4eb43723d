"""The numbers of a planned run, checked before anything is computed."""

import math

from ..errors import UsageError


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
