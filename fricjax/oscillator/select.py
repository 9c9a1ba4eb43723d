"""Choosing an engine for an oscillator."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any

import diffrax
import numpy as np
from jax.core import Tracer

from ..errors import check_choice
from ..settings import ENGINES
from .engines.base import AbstractEngine
from .engines.events import Events
from .engines.exact import Exact
from .engines.hybrid import Hybrid
from .engines.smooth import Smooth
from .oscillator import Oscillator

# diffrax takes the tolerance of the stages from a controller only where it sees the solver bare.
_KVAERNO = diffrax.Kvaerno5(scan_kind="lax", root_finder=diffrax.VeryChord(rtol=1e-10, atol=1e-12))


def select_engine(
    engine: str | AbstractEngine, oscillator: Oscillator, *, accuracy: float = 1e-10, max_half_cycles: int = 512
) -> AbstractEngine:
    """The engine of that name, or for "auto" the fastest one that can integrate the oscillator.

    Args:
        engine: "auto", "exact", "hybrid", "smooth", "diffrax", or an engine, which is checked and returned.
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
    engines = _engines(accuracy, max_half_cycles, oscillator.friction.step_refinement)
    if name == "diffrax":
        # Its own solvers from end to end: the reference, by which the others are tested.
        events = Events(accuracy, max_half_cycles)
        smooth = dataclasses.replace(engines["smooth"], method=_KVAERNO)
        return events if oscillator.friction.set_valued else smooth
    if name in engines:
        return engines[name]
    check_choice("engine", name, ENGINES)
    # A drag that is being differentiated counts as present, whatever its value.
    without_drag = isinstance(oscillator.drag, np.ndarray)
    candidates = [engines[candidate] for candidate in (("exact", "hybrid") if without_drag else ("hybrid",))]
    return next((e for e in candidates if e.refusal(oscillator) is None), engines["smooth"])


@functools.cache
def _engines(accuracy: float, max_half_cycles: int, divisor: int) -> Mapping[str, AbstractEngine]:
    return {
        "exact": Exact(max_half_cycles),
        "hybrid": Hybrid(nodes=nodes_for(accuracy) * divisor, max_half_cycles=max_half_cycles),
        "smooth": Smooth(accuracy=accuracy / divisor, max_half_cycles=max_half_cycles),
    }


def nodes_for(accuracy: float) -> int:
    """Steps per half-cycle of the hybrid engine for that accuracy [m] of a motion of a few millimetres, even."""
    return 2 * max(8, math.ceil(14 * (1e-10 / accuracy) ** (1 / 6)))


def concrete(value: Any) -> float | None:
    """A number where the value is known outside of a trace, else None."""
    return None if isinstance(value, Tracer) or np.ndim(value) else float(value)


def half_cycle_capacity(oscillator: Oscillator, duration: float | None, x0: Any, v0: Any) -> int:
    """How many half-cycles to provide for in a duration [s]: a power of two, so that few shapes are compiled.

    A stiffening spring is at its fastest where the motion from `x0` [m] and `v0` [m/s] may reach. Where the duration or
    the oscillator is traced or batched the answer is 512.
    """
    known = [concrete(v) for v in (oscillator.mass, oscillator.stiffness, x0, v0)]
    if duration is None or any(value is None for value in known):
        return 512
    mass, stiffness, x, v = (float(value or 0.0) for value in known)
    reach = abs(x) + abs(v) * math.sqrt(mass / stiffness)
    secant: float = stiffness
    if oscillator.restoring.stiffens and reach > 0:
        pull = concrete(oscillator.restoring_force(np.asarray(reach)))  # pyright: ignore[reportArgumentType]
        if pull is None:
            return 512
        secant = max(stiffness, pull / reach)
    half_cycles = 1.2 * duration * math.sqrt(secant / mass) / math.pi + 4
    return max(16, 2 ** math.ceil(math.log2(half_cycles)))
