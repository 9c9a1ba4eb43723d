"""A trace holds displacement over time as arrays.

A `Trace` is a pytree of arrays, so you can pass it into compiled functions, stack it and map over it. Files, units,
names and logs stay outside of it, in the `Record`. Lists and numpy arrays become numpy float64 arrays, so that no digit
is lost while jax runs in single precision. Jax arrays are kept unchanged.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from ..errors import DataError, UsageError
from .units import check_rate

MINIMUM_SAMPLES = 3


class Trace(eqx.Module):
    """Displacement over time, with its noise and a mask.

    **Arguments:**

    - `t`: times [s], shape `(n,)`, finite and strictly increasing; `n >= 3`.
    - `x`: displacements [m] or angles [rad], shape `(n,)`. Samples that are not finite are masked and stored as 0.
    - `sigma`: standard deviation of the noise of `x` [m or rad], one number or shape `(n,)`; None if unknown.
    - `mask`: shape `(n,)`, True where a sample is used; None: wherever `x` is finite.
    - `rate`: samples per second, instead of `t`; the first sample is then at 0 s.

    For files, data frames and xarray arrays with units, use `fricjax.read(table).trace`.

    Raises `DataError` if the arrays do not form a trace, and `UsageError` if `x` is missing or if not exactly one of
    `t` and `rate` is given.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> trace = fj.Trace(x=2e-3 * np.cos(np.arange(500)), rate=5000.0, sigma=1e-9)
        >>> trace.n, round(float(trace.duration), 4)
        (500, 0.0998)
        >>> import pandas as pd
        >>> table = pd.DataFrame({"t [ms]": 0.2 * np.arange(500), "x [mm]": 2.0 * np.cos(np.arange(500))})
        >>> float(fj.read(table).trace.x[0])
        0.002
    """

    t: Float[Array | np.ndarray, " n"]
    x: Float[Array | np.ndarray, " n"]
    sigma: Float[Array | np.ndarray, "*sigma"] | None
    mask: Bool[Array | np.ndarray, " n"]

    def __init__(self, t: Any = None, x: Any = None, sigma: Any = None, mask: Any = None, *, rate: float | None = None):
        if x is None or (t is None) == (rate is None):
            raise UsageError(
                "A trace is made of displacements and either their times or their rate: Trace(t, x) or "
                "Trace(x=x, rate=5000.0). A file, a data frame or an array of xarray is read by "
                "fricjax.read, and fricjax.read(table).trace is its trace."
            )
        x = _floats(x, "x")
        if rate is not None:
            check_rate(rate)
            t = np.arange(x.size) / float(rate)
        t, sigma = _floats(t, "t"), None if sigma is None else _floats(sigma, "sigma")
        _check_shapes(t, x, sigma)
        isfinite = jnp.isfinite if isinstance(x, jax.Array) else np.isfinite
        mask = isfinite(x) if mask is None else _checked_mask(mask, x) & isfinite(x)
        _check_values(t, sigma)
        self.t, self.sigma, self.mask = t, sigma, mask
        # A NaN multiplied by a zero weight would still be NaN in traced code, so store zero for such samples.
        if isinstance(x, jax.Array):
            self.x = jnp.where(jnp.isfinite(x), x, jnp.zeros_like(x))
        else:
            self.x = x if np.all(mask) else np.where(np.isfinite(x), x, 0.0)

    @property
    def n(self) -> int:
        """Number of samples, masked ones included."""
        return self.t.shape[-1]

    @property
    def duration(self) -> Any:
        """Time from the first to the last sample [s]."""
        return self.t[..., -1] - self.t[..., 0]

    @property
    def n_used(self) -> Any:
        """Number of samples that are not masked out."""
        return self.mask.sum(axis=-1)


def _floats(values: Any, name: str) -> Any:
    # The casts of numpy and jax would drop imaginary parts and turn dates into numbers.
    if getattr(getattr(values, "dtype", None), "kind", "f") in "cmM":
        raise DataError(f"{name} must hold real numbers, but its type is {values.dtype}.")
    if isinstance(values, jax.Array):
        return values if jnp.issubdtype(values.dtype, jnp.floating) else values.astype(float)
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name} must hold real numbers, but it could not be converted: {error}.") from error


def _check_shapes(t: Any, x: Any, sigma: Any) -> None:
    for name, array in (("t", t), ("x", x)):
        if array.ndim != 1:
            raise DataError(
                f"{name} must be one-dimensional, but it has shape {array.shape}; pass one trace at a time."
            )
    if t.shape != x.shape:
        raise DataError(f"t and x must have the same length, but t has {t.shape[0]} samples and x has {x.shape[0]}.")
    if t.shape[0] < MINIMUM_SAMPLES:
        raise DataError(f"A trace needs at least {MINIMUM_SAMPLES} samples, but only {t.shape[0]} were given.")
    if sigma is not None and sigma.shape not in ((), t.shape):
        raise DataError(f"sigma must be one number or one per sample ({t.shape[0]}), but it has shape {sigma.shape}.")


def _checked_mask(mask: Any, x: Any) -> Any:
    mask = mask if isinstance(mask, jax.Array) else np.asarray(mask)
    if mask.dtype != bool:
        raise DataError(f"mask must be boolean (True: the sample is used), but its type is {mask.dtype}.")
    if mask.shape != x.shape:
        raise DataError(f"mask must have one entry per sample ({x.shape[0]}), but it has shape {mask.shape}.")
    return mask


def _check_values(t: Any, sigma: Any) -> None:
    """Refuse invalid times and sigma.

    The values of traced arrays cannot be checked.
    """
    if not isinstance(t, Tracer):
        t = np.asarray(t)
        finite = np.isfinite(t)
        if not finite.all():
            i = int(np.argmin(finite))
            raise DataError(f"t must be finite, but sample {i} is {t[i]}; drop such samples or give a rate.")
        i = first_not_later(t)
        if i is not None:
            raise DataError(
                f"t must increase strictly, but sample {i} is {float(t[i])} s after {float(t[i - 1])} s; sort the "
                "samples and drop repeated ones."
            )
    if sigma is not None and not isinstance(sigma, Tracer):
        sigma = np.asarray(sigma).ravel()
        bad = np.flatnonzero(~((sigma > 0) & np.isfinite(sigma)))
        if bad.size:
            raise DataError(f"sigma must be positive and finite, but it is {sigma[bad[0]]:g} (entry {bad[0]}).")


def first_not_later(t: np.ndarray) -> int | None:
    """Return the index of the first time that does not increase.

    Returns None if all times increase.
    """
    later = t[1:] > t[:-1]
    return None if later.all() else int(np.argmin(later)) + 1
