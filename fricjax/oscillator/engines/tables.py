"""The table of amplitudes that the records of a fit ask for: its range, and the entries that keep its error small."""

from typing import Any, NamedTuple, cast

import numpy as np

from ..oscillator import Oscillator
from ..restoring import Pendulum
from .amplitudes import Span
from .base import Seen

# Half-cycles from which a table over amplitude pays, and its entries per e-fold of amplitude for 1e-2 nm on 2 mm. The
# number goes with the angle in the complex plane over which the motion stays smooth: a quarter of a turn about the dead
# band or for a tanh of the speed, half of that for the Gaussian of the speed in a law that falls.
_FEW, _PER_E_FOLD, _PER_E_FOLD_FALLING = 8, 5.0, 9.0
# The same per unit of the coordinate of a pendulum, for 1e-7 rad of drift over a hundred half-cycles from 3.1 rad on.
_PER_UNIT = 11.0
# How far beyond the largest deflection a table reaches, in the coordinate that has no bound at the top of a pendulum.
_BEYOND = 1.1
# Sizes of a table; laws that fall take the larger one, which most of their records need. Each is compiled for itself,
# in seconds, and a third of the entries, which are solved side by side, saves no more than a few per cent of a fit:
# `python experiments/benchmarks/cold.py`.
_SIZES = (24, 48)


class Asked(NamedTuple):
    """Range and number of entries of a table."""

    span: Span
    amplitudes: int


def table_for(oscillator: Oscillator, seen: Seen) -> Asked | None:
    """The table for what the records show; None where there is nothing that it could serve.

    A table is for motions from a standstill; it has one mesh for all amplitudes, and the kink of a hysteretic spring
    lies elsewhere at each.
    """
    if not seen.standing or oscillator.restoring.hysteretic or any(swings.size < _FEW for swings in seen.swings):
        return None
    span = _span(oscillator, min(float(s.min()) for s in seen.swings), max(float(s.max()) for s in seen.swings))
    needed = _needed(oscillator, span)
    return Asked(span, next((size for size in _SIZES if size >= needed and not _falls(oscillator)), _SIZES[-1]))


def _span(oscillator: Oscillator, least: float, highest: float) -> Span:
    """The range of a table for these deflections."""
    band, spring = float(oscillator.dead_band), cast("Any", oscillator.restoring)
    # Near the dead band, where the phase leaps, the margin is narrow.
    lowest = least - 0.2 * max(least - band, 0.0)
    # With a wrong offset a reading may lie beyond the top itself.
    ratio = spring.steepened(np.float64(min(highest, spring.largest)))
    highest = spring.unsteepened(np.float64(_BEYOND * float(ratio)))
    return Span(np.asarray(lowest), np.asarray(highest), np.asarray(0.0))


def _needed(oscillator: Oscillator, span: Span) -> float:
    """Entries that the table of a range must have."""
    band, spring = float(oscillator.dead_band), cast("Any", oscillator.restoring)
    lowest, highest = (float(spring.steepened(np.float64(end))) for end in span[:2])
    low, high = (float(spring.spread(np.float64(end))) for end in (max(lowest - band, 0.1 * lowest), highest))
    per_e_fold = _PER_E_FOLD_FALLING if _falls(oscillator) else _PER_E_FOLD
    return (_PER_UNIT if isinstance(spring, Pendulum) else per_e_fold) * (high - low)


def _falls(oscillator: Oscillator) -> bool:
    """Whether the friction of a set-valued law changes with the speed."""
    return oscillator.friction.set_valued and bool(np.isfinite(float(oscillator.friction.velocity_scale())))
