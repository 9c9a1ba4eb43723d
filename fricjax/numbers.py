"""Numbers in arguments of public functions, and lengths of Fourier transforms."""

import bisect
import functools
import math
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


@functools.lru_cache(maxsize=32)
def fast_length(n: int, *, at_most: bool = False) -> int:
    """Return the smallest 5-smooth integer of at least `n`.

    A fast Fourier transform of this length is efficient. The functions `next_fast_len` and `prev_fast_len` of
    `scipy.fft` are equivalent, but importing SciPy would slow down a first fit.

    Args:
        n: a length of at least one.
        at_most: return the largest one of at most `n` instead.

    Examples:
        >>> fast_length(1000), fast_length(1025), fast_length(1025, at_most=True)
        (1000, 1080, 1024)
    """
    powers = [[base**i for i in range(n.bit_length() + 1)] for base in (2, 3, 5)]
    smooth = sorted(a * b * c for a in powers[0] for b in powers[1] for c in powers[2])
    return smooth[bisect.bisect_right(smooth, n) - 1] if at_most else smooth[bisect.bisect_left(smooth, n)]


def number(name: str, value: Any, unit: str = "") -> float:
    """Convert the value to a finite float.

    Raises:
        UsageError: the value is not a single finite number.

    Examples:
        >>> number("length", "0.42")
        0.42
    """
    try:
        result = float(value)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be one number{in_unit(unit)}, got {value!r}.") from error
    if not math.isfinite(result):
        raise UsageError(f"{name} must be a finite number{in_unit(unit)}, got {value!r}.")
    return result


def in_unit(unit: str) -> str:
    """Return " of" and the unit, empty without one.

    Examples:
        >>> in_unit("m")
        ' of m'
    """
    return f" of {unit}" if unit else ""
