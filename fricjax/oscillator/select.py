"""Choosing an engine for an oscillator."""

import math
from typing import Any

import numpy as np
from jax.core import Tracer

from .engines.base import AbstractEngine
from .engines.exact import Exact
from .engines.hybrid import Hybrid
from .engines.smooth import Smooth
from .oscillator import Oscillator

ENGINES = ("auto", "exact", "hybrid", "smooth")


def select_engine(
    engine: str | AbstractEngine, oscillator: Oscillator, *, accuracy: float = 1e-10, max_half_cycles: int = 512
) -> AbstractEngine:
    """The engine of that name, or for "auto" the fastest one that can integrate the oscillator.

    Args:
        engine: "auto", "exact", "hybrid", "smooth", or an engine, which is checked and returned.
        oscillator: what it is to integrate.
        accuracy: largest error of the displacement aimed at [m].
        max_half_cycles: number of half-cycles to provide for.

    Raises:
        ValueError: no such engine, or one that cannot integrate this oscillator; the message says why.
    """
    chosen = engine if isinstance(engine, AbstractEngine) else _named(engine, oscillator, accuracy, max_half_cycles)
    reason = chosen.refusal(oscillator)
    if reason is not None:
        raise ValueError(reason)
    return chosen


def _named(name: str, oscillator: Oscillator, accuracy: float, max_half_cycles: int) -> AbstractEngine:
    nodes = max(16, math.ceil(32 * (1e-10 / accuracy) ** (1 / 6)))
    exact = Exact(max_half_cycles)
    hybrid = Hybrid(nodes=nodes, max_half_cycles=max_half_cycles)
    smooth = Smooth(accuracy=accuracy, max_half_cycles=max_half_cycles)
    named = {"exact": exact, "hybrid": hybrid, "smooth": smooth}
    if name in named:
        return named[name]
    if name != "auto":
        raise ValueError(f"There is no engine {name!r}. Choose one of {', '.join(ENGINES)}.")
    without_drag = isinstance(oscillator.drag, np.ndarray)
    candidates = (exact, hybrid, smooth) if without_drag else (hybrid, smooth)
    return next((e for e in candidates if e.refusal(oscillator) is None), smooth)


def concrete(value: Any) -> float | None:
    """A number where the value is known outside of a trace, else None."""
    return None if isinstance(value, Tracer) or np.ndim(value) else float(value)


def half_cycle_capacity(oscillator: Oscillator, duration: float | None, reach: Any) -> int:
    """How many half-cycles to provide for in a duration [s]: a power of two, so that few shapes are compiled.

    `reach` is the starting displacement [m], where a stiffening spring is at its fastest. Where the duration or the
    oscillator is traced or batched the answer is 512.
    """
    known = [concrete(v) for v in (oscillator.mass, oscillator.stiffness, oscillator.restoring_force(reach), reach)]
    if duration is None or any(value is None for value in known):
        return 512
    mass, stiffness, pull, start = (float(value or 0.0) for value in known)
    secant = max(stiffness, pull / start if start else 0.0)
    strokes = 1.2 * duration * math.sqrt(secant / mass) / math.pi + 4
    return max(16, 2 ** math.ceil(math.log2(strokes)))
