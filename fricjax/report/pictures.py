"""Compact encoding of the curves of many runs.

A point has 16 bits. Blocks of runs are encoded separately, and a browser decodes one block at a time.
"""

import base64
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..data.observation import observation_of
from ..data.units import DISPLACEMENT
from .columns import numbers, packed, typical_unit

if TYPE_CHECKING:
    from pandas import DataFrame

# In the order of the bytes of a run.
CURVES = ("t", "x", "residual", "reversal_t", "reversal_x", "speed", "friction")
# Largest level of a point; the level above it marks a missing number.
_LEVELS, _MISSING = 65534, 65535
# Decoding a block of this size takes milliseconds.
_RUNS_PER_BLOCK = 200


class Curves(NamedTuple):
    """One curve of each run, concatenated.

    Attributes:
        points: points of all runs, NaN for a missing one, shape (points,).
        sizes: number of points of each run, shape (runs,).
    """

    points: np.ndarray
    sizes: np.ndarray

    @classmethod
    def of(cls, arrays: Sequence[np.ndarray]) -> "Curves":
        """Concatenate the curves of some runs; a scalar is an empty curve."""
        sizes = np.array([np.size(each) if np.ndim(each) else 0 for each in arrays], int)
        kept = [each for each, size in zip(arrays, sizes, strict=True) if size]
        return cls(np.concatenate(kept).astype("f8") if kept else np.empty(0), sizes)

    def extremes(self, extreme: np.ufunc) -> np.ndarray:
        """Lowest or highest point of each run, shape (runs,).

        Args:
            extreme: `np.fmin` or `np.fmax`; both ignore missing points.
        """
        reached, some = np.full(self.sizes.size, np.nan), self.sizes > 0
        begins = np.concatenate([[0], np.cumsum(self.sizes[some])[:-1]]).astype(int)
        reached[some] = extreme.reduceat(self.points, begins) if some.any() else np.nan
        return reached

    def times(self, factor: float | np.ndarray) -> "Curves":
        """Multiply the curves by one factor, or by a factor per run."""
        factors = np.repeat(factor, self.sizes) if np.ndim(factor) else factor
        return Curves(self.points * factors, self.sizes)


def pictures(frame: "DataFrame", quantity: str) -> tuple[dict[str, Any], list[str]]:
    """Encode the curves of all runs of a table.

    Args:
        frame: a table with the columns ``sketch_*`` and ``reversal_*``, lists of numbers.
        quantity: unit of the reading, such as "m", "rad" or "rad/s".

    Returns:
        The description of the bytes, and the bytes as base64, one text per block of runs. The friction of half-cycles
        is mu if all runs with curves were fitted with Coulomb's law alone, else the dead band.
    """
    t, x, residual, reversal_t, reversal_x = (
        Curves.of(list(frame[name]) if name in frame else [np.empty(0)] * len(frame))
        for name in ("sketch_t", "sketch_x", "sketch_residual", "reversal_t", "reversal_x")
    )
    damping, dead_band, mu = (numbers(frame, name) for name in ("damping_ratio", "dead_band", "mu"))
    ends = np.cumsum(reversal_t.sizes)[:-1]
    reversals = zip(np.split(reversal_t.points, ends), np.split(reversal_x.points, ends), damping, strict=True)
    half_cycles = [half_cycles_of(*each) for each in reversals]
    speed, band = (Curves.of([getattr(each, name) for each in half_cycles]) for name in ("speed", "dead_band"))
    factor_x, unit_x = typical_unit(x.extremes(np.fmax), quantity)
    factor_r, unit_r = typical_unit(residual.points, quantity)
    factor_v, unit_v = typical_unit(speed.extremes(np.fmax), f"{quantity}/s")
    factor_b, unit_b = typical_unit(band.extremes(np.fmax), quantity)
    as_mu = "friction" in frame and np.isfinite(mu).any() and set(frame["friction"][np.isfinite(mu)]) == {"coulomb"}
    with np.errstate(divide="ignore", invalid="ignore"):
        friction = mu / dead_band if as_mu else np.full(len(frame), factor_b)
    about = {
        "curves": CURVES,
        "name": "Displacement" if quantity in DISPLACEMENT else observation_of({"quantity": quantity}).name,
        "units": {"t": "s", "x": unit_x, "residual": unit_r, "speed": unit_v, "friction": "" if as_mu else unit_b},
        # Factor from the unit of residuals to the unit of displacements.
        "residualUnit": factor_x / factor_r,
        "frictionIsMu": bool(as_mu),
        "noise": packed(factor_r * numbers(frame, "sigma"), "<f4"),
        "fitted": packed(friction * dead_band, "<f4"),
        "runsPerBlock": _RUNS_PER_BLOCK,
    }
    positions = (t, x.times(factor_x), residual.times(factor_r), reversal_t, reversal_x.times(factor_x))
    runs = encoded([*positions, speed.times(factor_v), band.times(friction)])
    blocks = [b"".join(runs[begin : begin + _RUNS_PER_BLOCK]) for begin in range(0, len(runs), _RUNS_PER_BLOCK)]
    return about | {"sizes": [len(run) for run in runs]}, [base64.b64encode(each).decode("ascii") for each in blocks]


def encoded(curves: Sequence[Curves]) -> list[bytes]:
    """Encode the curves of each run as bytes.

    A curve consists of the number of points (uint32), its lowest and highest value (two float32), and the levels of the
    points (uint16), all little-endian. It is padded to a multiple of four bytes. A run with an empty first curve has no
    bytes.

    Examples:
        >>> import numpy as np
        >>> [len(run) for run in encoded([Curves.of([np.array([0.0, 0.5, np.nan]), np.empty(0)])])]
        [20, 0]
    """
    parts = [list(_encoded(curve)) for curve in curves]
    drawn = curves[0].sizes > 0
    return [b"".join(run) if some else b"" for some, run in zip(drawn, zip(*parts, strict=True), strict=True)]


def _encoded(curves: Curves) -> Iterator[bytes]:
    """Encode one curve of each run."""
    # Limits are float32: a larger point, which only a damaged file has, counts as missing.
    curves = curves._replace(points=np.where(np.abs(curves.points) < np.finfo("f4").max, curves.points, np.nan))
    low, high = (np.nan_to_num(curves.extremes(which)) for which in (np.fmin, np.fmax))
    scale = np.divide(_LEVELS, high - low, out=np.zeros(low.size), where=high > low)
    levels = np.rint((curves.points - np.repeat(low, curves.sizes)) * np.repeat(scale, curves.sizes))
    stored = np.where(np.isfinite(levels), levels, _MISSING).astype("<u2").tobytes()
    limits, end = np.column_stack([low, high]).astype("<f4"), 0
    for size, limit in zip(curves.sizes.tolist(), limits, strict=True):
        begin, end = end, end + 2 * size
        yield size.to_bytes(4, "little") + limit.tobytes() + stored[begin:end] + bytes(2 * (size % 2))


class HalfCycles(NamedTuple):
    """Half-cycles of a run from its reversals.

    Attributes:
        speed: mean velocity with its sign [m/s], shape (half-cycles,).
        dead_band: mean friction force over stiffness [m], shape (half-cycles,). This friction would hold the mass in a
            band of twice this width.
    """

    speed: np.ndarray
    dead_band: np.ndarray


def half_cycles_of(times: np.ndarray, positions: np.ndarray, damping_ratio: float) -> HalfCycles:
    """Compute the friction of the half-cycles without the viscous loss.

    The spring is linear. A shift of the equilibrium increases the friction in one direction and decreases it in the
    other. Therefore the equilibrium is chosen so that the mean friction is equal in both directions. This removes the
    effect of a tilt.

    With the amplitudes a_n about the equilibrium, and the amplitude ratio ``rho = exp(-pi zeta/sqrt(1 - zeta^2))`` of
    viscous damping, Coulomb friction gives ``a_{n+1} = rho a_n - (1 + rho) F/k``. A variation with speed or amplitude
    is a deviation from Coulomb friction.

    Args:
        times: times of the reversals [s], shape (reversals,).
        positions: displacements at the reversals, relative to the approximate equilibrium [m], shape (reversals,).
        damping_ratio: damping ratio zeta. If it is NaN, the result is empty.

    Examples:
        >>> import numpy as np
        >>> half_cycles_of(np.array([0.0, 1.0, 2.0]), np.array([5.0, -3.0, 1.0]), 0.0).dead_band
        array([1., 1.])
    """
    if times.size < 2 or not abs(damping_ratio) < 1:
        return HalfCycles(np.empty(0), np.empty(0))
    path = np.diff(positions)
    side = -np.sign(path)
    rho = np.exp(-np.pi * damping_ratio / np.sqrt(1 - damping_ratio**2))
    dead_band = side * (rho * positions[:-1] + positions[1:]) / (1 + rho)
    if np.unique(side).size > 1:
        dead_band -= side * (dead_band[side > 0].mean() - dead_band[side < 0].mean()) / 2
    return HalfCycles(path / np.diff(times), dead_band)
