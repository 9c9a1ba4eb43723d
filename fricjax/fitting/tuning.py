"""The engine of a fit: built for its records, and for an error below what their noise leaves visible."""

from collections.abc import Sequence
from typing import Any, cast

import equinox as eqx
import numpy as np

from ..data.errors import UsageError
from ..oscillator import Exact, Hybrid, Oscillator, Smooth
from ..oscillator.engines import UNTABLED, AbstractEngine, Span
from ..oscillator.restoring import Pendulum
from ..oscillator.select import select_engine
from .parameters import Request
from .sizes import power
from .window import NEVER, Window, equilibrium

# The error of the smooth engine is some ten times smaller than the accuracy that it is asked for.
_SLACK = 1.0
# Half-cycles from which a table over amplitude pays, and its entries per e-fold of amplitude for 1e-2 nm on 2 mm. The
# number goes with the angle in the complex plane over which the motion stays smooth: a quarter of a turn about the dead
# band or for a tanh of the speed, half of that for the Gaussian of the speed in a law that falls.
_FEW, _PER_E_FOLD, _PER_E_FOLD_FALLING = 8, 5.0, 9.0
# The same per unit of the coordinate of a pendulum, for 1e-7 rad of drift over a hundred half-cycles from 3.1 rad on.
_PER_UNIT = 11.0
# How far beyond the largest deflection a table reaches, in the coordinate that has no bound at the top of a pendulum.
_BEYOND = 1.1
# Least number of half-cycles to provide for, so that records of an archive share their compilation.
_CAPACITY = 64
# Sizes of a table; laws that fall take the larger one, which most of their records need. Each is compiled for itself,
# in seconds, and a third of the entries, which are solved side by side, saves no more than a few per cent of a fit:
# `python experiments/benchmarks/cold.py`.
_SIZES = (24, 48)


def engine_for(request: Request, windows: Sequence[Window]) -> AbstractEngine:
    """The engine, built for the longest record and for an error below what its noise leaves visible."""
    machine, drag_free = request.oscillator, any(name.endswith("drag") for name in request.free)
    strokes = max(_strokes(window, can_stop(request)) for window in windows)
    name = "hybrid" if drag_free and request.engine == "auto" and machine.friction.set_valued else request.engine
    try:
        engine = select_engine(name, machine, max_half_cycles=power(strokes + 2, _CAPACITY))
    except ValueError as error:
        raise UsageError(str(error)) from error
    if drag_free and isinstance(engine, Exact):
        raise UsageError("drag is free, and the exact engine has no drag. Use the hybrid engine.")
    return engine if isinstance(request.engine, AbstractEngine) else _tuned(engine, machine, windows)


def _tuned(engine: AbstractEngine, machine: Oscillator, windows: Sequence[Window]) -> AbstractEngine:
    """The engine with what the records tell: the accuracy that their noise asks for, or their range of amplitudes."""
    if isinstance(engine, Exact):
        # It computes no half-cycle that is not asked for, so that all records may share one capacity.
        return Exact(max(Exact().max_half_cycles, engine.max_half_cycles))
    if isinstance(engine, Smooth):
        accuracy = _SLACK * min(float(np.median(w.sigma)) / np.sqrt(w.used.sum()) for w in windows)
        return eqx.tree_at(lambda e: (e.accuracy, e.still), engine, (np.asarray(accuracy), np.asarray(accuracy)))
    moving = any("v0" in w.nuisances or w.guesses["v0"] != 0 for w in windows)
    # A table has one mesh for all amplitudes, and the kink of a hysteretic spring lies elsewhere at each.
    if not isinstance(engine, Hybrid):
        return engine
    engine = Hybrid(engine.nodes, engine.max_half_cycles, None, skew=np.asarray(engine.skew))
    spans = [_swings(window) for window in windows]
    if moving or machine.restoring.hysteretic or any(swings.size < _FEW for swings in spans):
        return engine
    span = _span(machine, min(float(s.min()) for s in spans), max(float(s.max()) for s in spans))
    needed = _needed(machine, span)
    amplitudes = next((size for size in _SIZES if size >= needed and not _falls(machine)), _SIZES[-1])
    return Hybrid(engine.nodes, engine.max_half_cycles, span, amplitudes, engine.skew)


def _span(machine: Oscillator, least: float, highest: float) -> Span:
    """The range of a table for these deflections."""
    band, spring = float(machine.dead_band), cast("Any", machine.restoring)
    # Near the dead band, where the phase leaps, the margin is narrow.
    lowest = least - 0.2 * max(least - band, 0.0)
    # With a wrong offset a reading may lie beyond the top itself.
    ratio = spring.steepened(np.float64(min(highest, spring.largest)))
    highest = spring.unsteepened(np.float64(_BEYOND * float(ratio)))
    return Span(np.asarray(lowest), np.asarray(highest), np.asarray(0.0))


def _needed(machine: Oscillator, span: Span) -> float:
    """Entries that the table of a range must have."""
    band, spring = float(machine.dead_band), cast("Any", machine.restoring)
    lowest, highest = (float(spring.steepened(np.float64(end))) for end in span[:2])
    low, high = (float(spring.spread(np.float64(end))) for end in (max(lowest - band, 0.1 * lowest), highest))
    per_e_fold = _PER_E_FOLD_FALLING if _falls(machine) else _PER_E_FOLD
    return (_PER_UNIT if isinstance(spring, Pendulum) else per_e_fold) * (high - low)


def _falls(machine: Oscillator) -> bool:
    """Whether the friction of a set-valued law changes with the speed."""
    return machine.friction.set_valued and bool(np.isfinite(float(machine.friction.velocity_scale())))


def _swings(window: Window) -> np.ndarray:
    """Deflections from which the half-cycles start that a table is to give, all but the last ones before a stop."""
    found = window.segmentation
    later = found.turning_times > window.t_start + found.half_period / 4
    swings = np.abs(found.turning_points[later] - equilibrium(found))
    by_table = window.half_cycles - UNTABLED if window.half_cycles < NEVER else swings.size + 1
    return np.append(abs(window.guesses["x0"]), swings)[: max(by_table, 0)]


def can_stop(request: Request) -> bool:
    """Whether the law can hold the mass, with the free coefficients away from zero."""
    machine, kinds = request.oscillator, {name.rsplit(".", 1)[-1] for name in request.free}
    held = bool(kinds & {"mu", "mu_s", "normal_force"})
    return held or float(machine.friction.static_force(machine.normal_force)) > 0


def _strokes(window: Window, stops: bool) -> int:
    """Half-cycles that the engine must provide for: those until the stop, or as many as the record can hold."""
    if stops and window.half_cycles < NEVER:
        return window.half_cycles
    return int(1.3 * float(window.trace.duration) / window.segmentation.half_period) + 4
