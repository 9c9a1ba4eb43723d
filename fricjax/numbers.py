"""Numbers in arguments of public functions."""

from typing import Any

import numpy as np

from .errors import UsageError, brief


def real(name: str, value: Any, expected: str = "a real number") -> np.ndarray:
    """Convert an argument to an array of real numbers.

    Raises:
        UsageError: a text, complex numbers, or an object that is no number.

    Examples:
        >>> float(real("x0", 2))
        2.0
        >>> real("x0", "wide")
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: x0 must be a real number, but it is 'wide'.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind in "fiub":
            return array.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        pass
    raise UsageError(f"{name} must be {expected}, but it is {brief(value)}.")


def scalar(name: str, value: Any) -> float:
    """Convert an argument to one real number.

    Raises:
        UsageError: anything else.

    Examples:
        >>> scalar("start", np.float32(0.5))
        0.5
    """
    number = real(name, value)
    if number.ndim:
        raise UsageError(f"{name} must be one number, but it has shape {number.shape}.")
    return float(number)
