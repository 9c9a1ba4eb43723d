"""Values of tabulated forces, under NumPy and under JAX."""

from typing import Any

import jax
import numpy as np

from .forces import Curve

_TINY = float(np.finfo(float).tiny)


def once(xp: Any, values: Any) -> Any:
    """Keep the compiler from recomputing these values at each use.

    Without it XLA evaluates the columns four times.
    """
    return values if xp is np else jax.lax.optimization_barrier(values)


def place(xp: Any, curve: Curve, side: Any, at: Any, branch: Any = None) -> tuple[Any, Any]:
    """Return index and local coordinate of the cells at `at`.

    Where `branch` is 1 or -1, the cell is one for positive or negative values, even if `at` is just beyond zero.
    """
    cells = curve.centres.shape[-1]
    cell_of = at if branch is None else xp.where(branch == 0, at, branch * xp.maximum(branch * at, _TINY))
    cell = xp.clip(xp.searchsorted(curve.edges, cell_of, side="right") - 1, 0, cells - 1).astype(np.int32)
    local = (at - xp.take(curve.centres, cell, mode="clip")) * xp.take(curve.scales, cell, mode="clip")
    return once(xp, (xp.where(side > 0, cell + np.int32(cells), cell), local))


def value_and_slope(xp: Any, curve: Curve, place: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return value and slope of a curve by Horner's rule."""
    index, local = place
    powers = xp.take(curve.value, index, axis=-1, mode="clip")
    value, slope = powers[-1], xp.zeros_like(local)
    for power in range(powers.shape[0] - 2, -1, -1):
        slope = slope * local + value
        value = value * local + powers[power]
    cells = np.int32(curve.scales.shape[-1])
    return value, slope * xp.take(curve.scales, xp.where(index >= cells, index - cells, index), mode="clip")


def columns_at(xp: Any, curve: Curve, place: tuple[Any, Any]) -> Any:
    """Return derivatives by the coefficients, shape (columns, half_cycles, points)."""
    powers = xp.take(curve.columns, place[0], axis=-1, mode="clip")
    value = powers[-1]
    for power in range(powers.shape[0] - 2, -1, -1):
        value = value * place[1] + powers[power]
    return value


def read(curve: Curve, side: np.ndarray, at: np.ndarray, columns: bool = False) -> np.ndarray:
    """Return values of a curve on the host.

    With `columns`, a first axis has the slope, the value and the columns.
    """
    cells = curve.centres.size
    cell = np.clip(np.searchsorted(curve.edges, at, side="right") - 1, 0, cells - 1)
    local = (at - curve.centres[cell]) * curve.scales[cell]
    table = np.concatenate([curve.value[:, None], curve.columns], axis=1) if columns else curve.value[:, None]
    powers = table[..., cell + cells * (side > 0)]
    value, slope = powers[-1], np.zeros_like(local)
    for power in powers[-2::-1]:
        slope = slope * local + value[0]
        value = value * local + power
    return np.concatenate([slope[None] * curve.scales[cell], value]) if columns else value[0]
