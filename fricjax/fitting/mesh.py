"""Meshes of the smooth engine: step lists that stay fixed during fits.

An adaptive solve determines the mesh of each run once. A mesh lives in the phase of the half-cycles, and behind the
last of them in scaled time, so it moves with the motion during the fit. In time the lengths of adjacent steps differ
little, so the mesh still fits after the parameters have changed. Meshes are padded to one of a few sizes, so that few
shapes are compiled; padding costs no steps.
"""

from typing import Any

import jax
import numpy as np

from ..errors import UsageError
from ..friction import AbstractFriction
from ..oscillator import Program
from .residual import Residual, Run, start_of, without_inputs

CAPACITY = 1 << 17
_REACH = 1.05
_GROWTH = 4.0
# For a bristle law a coarse mesh has 1100 steps for 5 half-cycles and 2900 for 50; the mesh of the check has twice as
# many. For elements that yield it has 3000 to 9000, and four times as many for the check; for the Leuven law 14,000 and
# 51,000. Padding to 8192 costs nothing; padding to 65536 costs as much as the steps.
_SIZES = tuple(2**power for power in (13, 15, 17, 19))
# Allowed ratio of the steps at the optimum to those at the start values.
_MORE = 1.1


def with_mesh(residual: Residual, y: Any, slack: float = 1.0) -> Residual:
    """Return the residual with a mesh for each run, made at `y`.

    Engines without a mesh leave it unchanged. `slack` is the factor by which the error may exceed the engine's. If it
    is above 1, padding leaves room for the mesh of the accuracy check. There is always room for a mesh that is
    replaced, so a fit compiles once.

    Raises:
        UsageError: more steps than the largest mesh holds.
    """
    if not residual.engine.needs_mesh:
        return residual
    bare, y = _bare(residual), y[: residual.n_parameters]
    engine: Any = residual.engine
    meshes = _meshes(engine.at_accuracy(slack * engine.accuracy), bare, y)
    lists = [(_finite(phases), _graded(_finite(times))) for phases, times in meshes]
    longest = max(phases.size + times.size - 1 for phases, times in lists)
    replaced: list[Any] = [run.engine for run in residual.runs if run.engine is not None]
    # A mesh that is replaced already has the least size.
    rooms = [longest, *([each.mesh.ends.size for each in replaced] or [_least_size(residual.oscillator.friction)])]
    if slack > 1:
        finest = _meshes(engine.checking(), bare, y)
        steps = max(sum(np.isfinite(ends).sum() for ends in pair) for pair in finest)
        rooms.append(min(int(_MORE * steps), _SIZES[-1]))
    size = next(size for size in _SIZES if size >= max(rooms))
    return residual.with_runs(engine=[engine.on_mesh(*pair, size) for pair in lists])


def likely(residual: Residual, y: Any) -> Residual | None:
    """Return the residual with empty meshes of the likely size.

    Programs for it can be compiled before the first mesh is known; this takes most of the time of a first fit. Return
    None if the mesh program is already compiled. An engine without meshes is returned unchanged.
    """
    engine: Any = residual.engine
    if not engine.needs_mesh:
        return residual
    if _meshes.is_compiled(engine, _bare(residual), y[: residual.n_parameters]):
        return None
    size = _least_size(residual.oscillator.friction)
    nothing = np.array([0.0, 1.0])
    return residual.with_runs(engine=[engine.on_mesh(nothing, nothing, size) for _ in residual.runs])


def _least_size(law: AbstractFriction) -> int:
    """Return the least mesh size of a law.

    Fits of a law then compile one size. One smooth state needs the first size. Several states, switches, or a refined
    step need the second. A law with more switches than moving states, such as Leuven on its return to steady sliding,
    needs the third.
    """
    moving = law.n_states - law.n_modes
    switches = jax.eval_shape(law.switches, *(jax.ShapeDtypeStruct(n, float) for n in ((), (law.n_states,), ()))).size
    return _SIZES[2 if switches > moving else 1 if (moving + switches) * law.step_refinement > 1 else 0]


def _bare(residual: Residual) -> Residual:
    """Return the residual with only the last instant of each run.

    Records of any length then share the compilation. Inputs of a rig are dropped, since they hardly move the motion.
    """
    runs = residual.runs
    none = {name: [getattr(run, name)[:0] for run in runs] for name in ("x", "weight")}
    return without_inputs(residual.with_runs(t=[run.t[-1:] for run in runs], **none, engine=[None] * len(runs)))


def _meshed(free: Any, residual: Residual, y: Any) -> list[tuple[Any, Any]]:
    machine = residual.machine(y)

    def one(number: Any, run: Run) -> tuple[Any, Any]:
        at = residual.parameters_of_run(residual.values(y), number, run)
        end = _REACH * (run.t[-1] - at["t_release"])
        return free.meshed(machine, start_of(machine, at), end, run.half_cycles, CAPACITY)

    return residual.each(one, residual.runs)


_meshes = Program(_meshed, lambda _, residual, __: [(0, 0) for _ in residual.runs])


def _finite(ends: Any) -> np.ndarray:
    """Return the finite steps, or a single step if none exist.

    The motion is not finite over that step.

    Raises:
        UsageError: the list is full.
    """
    known = np.asarray(ends)
    if not np.isfinite(known).any():
        return np.array([0.0, 1.0])
    if np.isfinite(known).all():
        raise UsageError(
            f"The motion needs more than {CAPACITY} steps of the smooth engine. Check the law's coefficients, or crop "
            "the record to its moving part."
        )
    # Rates are undefined on a step of zero length.
    return np.unique(known[np.isfinite(known)])


def _graded(mesh: np.ndarray) -> np.ndarray:
    """Halve steps until adjacent ones differ by at most a factor four."""
    while True:
        h = np.diff(mesh)
        shorter = np.minimum(np.r_[h[1:], np.inf], np.r_[np.inf, h[:-1]])
        long = np.flatnonzero(h > _GROWTH * shorter * (1 + 1e-9))
        if not long.size:
            return mesh
        mesh = np.sort(np.concatenate([mesh, mesh[long] + h[long] / 2]))
