"""The engine of a fit: built for its records, and for an error below what their noise leaves visible."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np

from ..errors import UsageError
from ..oscillator.engines import UNTABLED, AbstractEngine, Demands
from ..oscillator.select import select_engine
from .parameters import Request
from .sizes import power
from .window import NEVER, Window, equilibrium

# Least number of half-cycles to provide for, so that records of an archive share their compilation.
_CAPACITY = 64


def engine_for(request: Request, windows: Sequence[Window]) -> AbstractEngine:
    """The engine, built for the longest record and for an error below what its noise leaves visible."""
    machine = request.oscillator
    drag_free = any(name.endswith("drag") for name in request.free)
    strokes = max(_strokes(window, can_stop(request)) for window in windows)
    # A drag that is free is no number yet.
    known = eqx.tree_at(lambda machine: machine.drag, machine, np.asarray(np.nan)) if drag_free else machine
    try:
        engine = select_engine(request.engine, known, max_half_cycles=power(strokes + 2, _CAPACITY))
    except ValueError as error:
        raise UsageError(str(error)) from error
    # An engine that is given, not named, is taken as it is.
    return engine.tuned(machine, _demands(windows)) if isinstance(request.engine, str) else engine


def _demands(windows: Sequence[Window]) -> Demands:
    return Demands(
        deflections=[_swings(window) for window in windows],
        accuracy=min(float(np.median(w.sigma)) / np.sqrt(w.used.sum()) for w in windows),
        from_rest=not any("v0" in w.nuisances or w.guesses["v0"] != 0 for w in windows),
    )


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
