"""Engine selection."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np
from jax.core import Tracer

from ..errors import check_choice
from ..settings import ENGINES
from .engines.base import AbstractEngine
from .oscillator import Oscillator


def select_engine(
    engine: str | AbstractEngine, oscillator: Oscillator, *, accuracy: float = 1e-10, max_half_cycles: int = 512
) -> AbstractEngine:
    """Return the named engine, or for "auto" the fastest suitable one.

    Args:
        engine: "auto", "exact", "hybrid", "smooth", "diffrax", or an engine, which is checked and returned.
        oscillator: the oscillator to integrate.
        accuracy: target for the largest error of the displacement [m].
        max_half_cycles: capacity for half-cycles.

    Raises:
        ValueError: unknown engine, or one that cannot integrate this oscillator; the message states the reason.
    """
    chosen = engine if isinstance(engine, AbstractEngine) else _named(engine, oscillator, accuracy, max_half_cycles)
    reason = chosen.refusal(oscillator)
    if reason is not None:
        raise ValueError(reason)
    return chosen


def _named(name: str, oscillator: Oscillator, accuracy: float, max_half_cycles: int) -> AbstractEngine:
    check_choice("engine", name, ENGINES)
    law = oscillator.friction
    candidates: tuple[str, ...] = (name,)
    if name == "diffrax":
        # diffrax's own solvers from start to end: the reference for testing the other engines.
        candidates = ("events",) if law.set_valued else ("kvaerno",)
    elif name == "auto":
        # A drag that is differentiated counts as present, even if its value is zero.
        without_drag = isinstance(oscillator.drag, np.ndarray)
        candidates = ("exact", "hybrid", "smooth") if without_drag else ("hybrid", "smooth")
    engines = [_made(candidate, accuracy, max_half_cycles, law.step_refinement) for candidate in candidates[:-1]]
    fitting = (engine for engine in engines if engine.refusal(oscillator) is None)
    return next(fitting, None) or _made(candidates[-1], accuracy, max_half_cycles, law.step_refinement)


@functools.cache
def _made(name: str, accuracy: float, max_half_cycles: int, divisor: int) -> AbstractEngine:
    """Create the named engine without importing other engines.

    Importing diffrax takes longer than a fit.
    """
    if name == "exact":
        from .engines.exact import Exact

        return Exact(max_half_cycles)
    if name == "hybrid":
        from .engines.hybrid import Hybrid, nodes_for

        return Hybrid(nodes=nodes_for(accuracy) * divisor, max_half_cycles=max_half_cycles)
    if name == "events":
        from .engines.events import Events

        return Events(accuracy, max_half_cycles)
    from .engines.smooth import Smooth

    smooth = Smooth(accuracy=accuracy / divisor, max_half_cycles=max_half_cycles)
    if name == "smooth":
        return smooth
    import diffrax

    return dataclasses.replace(smooth, method=diffrax.Kvaerno5())


def concrete(value: Any) -> float | None:
    """Return a scalar as a float, or None if traced or batched."""
    return None if isinstance(value, Tracer) or np.ndim(value) else float(value)


def _half_cycles_to_rest(oscillator: Oscillator, reach: float, secant: float) -> float:
    """Return an upper bound on the half-cycles to rest, inf if unknown.

    Each half-cycle from a deflection of at most `reach` [m] shortens it by at least twice the least sliding force over
    the stiffness `secant` [N/m].
    """
    law, machine = oscillator.friction, oscillator
    mass, load, damping, drag = map(concrete, (machine.mass, machine.normal_force, machine.damping, machine.drag))
    if not law.set_valued or not mass or load is None or damping is None or drag is None or min(damping, drag) < 0:
        return math.inf
    fastest = reach * math.sqrt(secant / mass)
    forces = law.sliding_force(np.linspace(0.0, fastest, 200)[:, None], np.asarray(load))  # pyright: ignore
    least = None if isinstance(forces, Tracer) else float(np.min(forces))
    return math.inf if least is None or least <= 0 else reach * secant / (2 * least) + 4


def half_cycle_capacity(oscillator: Oscillator, duration: float | None, x0: Any, v0: Any) -> int:
    """Return the half-cycle capacity for a duration [s], a power of two.

    Powers of two limit the number of compiled shapes. For a stiffening spring the bound uses the largest deflection
    reachable from `x0` [m] and `v0` [m/s]. Dry friction stops the mass after a number of half-cycles that does not
    depend on the duration. If the duration or the oscillator is traced or batched, or if nothing bounds the number, the
    capacity is 512.
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
    if half_cycles > 512:
        half_cycles = min(half_cycles, _half_cycles_to_rest(oscillator, reach, secant))
    return 512 if math.isinf(half_cycles) else max(16, 2 ** math.ceil(math.log2(half_cycles)))
