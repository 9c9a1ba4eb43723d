"""A trace is displacement over time, as arrays and nothing else.

It is the border between the host side (files, units, names, logs) and the traced side (jit, vmap, derivatives): a
`Trace` is a pytree of arrays, so it may be passed into compiled functions, stacked and mapped. Lists and numpy arrays
are kept as numpy float64, so that no digit is lost while jax still runs in single precision; jax arrays pass as they
are.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from .errors import DataError

MINIMUM_SAMPLES = 3


class Trace(eqx.Module):
    """Displacement over time, with its noise and the samples that count.

    **Arguments:**

    - `t`: times [s], shape `(n,)`, finite and strictly increasing; `n >= 3`.
    - `x`: displacements [m] or angles [rad], shape `(n,)`. Samples that are not finite are masked out and held as 0.
    - `sigma`: standard deviation of the noise of `x` [m or rad], one number or shape `(n,)`; None: not known.
    - `mask`: shape `(n,)`, True where a sample is used; None: wherever `x` is finite.

    Raises `DataError` with one sentence where the arrays do not make a trace.
    """

    t: Float[Array | np.ndarray, " n"]
    x: Float[Array | np.ndarray, " n"]
    sigma: Float[Array | np.ndarray, "*sigma"] | None
    mask: Bool[Array | np.ndarray, " n"]

    def __init__(self, t: Any, x: Any, sigma: Any = None, mask: Any = None):
        t, x = _floats(t, "t"), _floats(x, "x")
        sigma = None if sigma is None else _floats(sigma, "sigma")
        _check_shapes(t, x, sigma)
        mask = _used(x, mask)
        _check_values(t, sigma)
        self.t, self.sigma, self.mask = t, sigma, mask
        self.x = _where_used(mask, x)

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
    if isinstance(values, jax.Array):
        return values if jnp.issubdtype(values.dtype, jnp.floating) else values.astype(float)
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name} must hold real numbers, but it could not be converted: {error}.") from error


def _is_concrete(array: Any) -> bool:
    return not isinstance(array, Tracer)


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


def _used(x: Any, mask: Any) -> Any:
    """The mask as booleans, without the samples whose displacement is not finite."""
    isfinite = jnp.isfinite if isinstance(x, jax.Array) else np.isfinite
    if mask is None:
        return isfinite(x)
    mask = mask if isinstance(mask, jax.Array) else np.asarray(mask)
    if mask.dtype != bool:
        raise DataError(f"mask must be boolean (True: the sample is used), but its type is {mask.dtype}.")
    if mask.shape != x.shape:
        raise DataError(f"mask must have one entry per sample ({x.shape[0]}), but it has shape {mask.shape}.")
    return mask & isfinite(x)


def _where_used(mask: Any, x: Any) -> Any:
    """Zero for what is not finite: a NaN multiplied by a zero weight would still be NaN in traced code."""
    if isinstance(x, jax.Array):
        return jnp.where(jnp.isfinite(x), x, jnp.zeros_like(x))
    return x if np.all(mask) else np.where(np.isfinite(x), x, 0.0)


def _check_values(t: Any, sigma: Any) -> None:
    if _is_concrete(t):
        _check_times(np.asarray(t))
    if sigma is not None and _is_concrete(sigma):
        bad = np.flatnonzero(~((np.asarray(sigma) > 0) & np.isfinite(np.asarray(sigma))).ravel())
        if bad.size:
            got = np.asarray(sigma).ravel()[bad[0]]
            raise DataError(f"sigma must be positive and finite, but it is {got:g} (entry {bad[0]}).")


def _check_times(t: np.ndarray) -> None:
    missing = np.flatnonzero(~np.isfinite(t))
    if missing.size:
        raise DataError(
            f"t must be finite, but sample {missing[0]} is {t[missing[0]]}; drop such samples or give a rate."
        )
    steps_back = np.flatnonzero(np.diff(t) <= 0)
    if steps_back.size:
        i = steps_back[0]
        raise DataError(
            f"t must increase strictly, but sample {i + 1} is {float(t[i + 1])} s after {float(t[i])} s; sort the "
            "samples and drop repeated ones."
        )
