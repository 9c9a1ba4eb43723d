"""The steps of the smooth engine during a fit: found once for each run by an adaptive solve, then kept.

The mesh lives in the phase of the half-cycles, and behind the last of them in scaled time, so it moves with the motion
while the fit runs. In time neighbouring steps are made to differ little in length, so that the mesh still fits when
the parameters have moved; there is room for one of a few numbers of steps, so that few shapes are compiled, which
costs no steps.
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
# Of a bristle law a rough mesh has 1100 steps over five half-cycles and 2900 over fifty, and that of the check twice as
# many; of elements that yield it has 3000 to 9000, and that of the check four times as many; of those that follow a
# mean deflection (Leuven's) 14,000 and 51,000. What is not used of 8192 places costs nothing, of 65536 as much as the
# steps.
_SIZES = tuple(2**power for power in (13, 15, 17, 19))
# How many more steps there may be at the optimum than at the start values.
_MORE = 1.1


def with_mesh(residual: Residual, y: Any, slack: float = 1.0) -> Residual:
    """The residual with a mesh for each run, made for coordinates `y`; unchanged for engines that need none.

    `slack` is the factor by which the error may be larger than the engine's. Where it is, there is room for the steps
    of its check, which are counted, and there always is for those of a mesh that is replaced: a fit compiles once.

    Raises:
        UsageError: more steps than a list of them can hold.
    """
    if not residual.engine.needs_mesh:
        return residual
    bare, y = _bare(residual), y[: residual.n_parameters]
    engine: Any = residual.engine
    meshes = _meshes(engine.at_accuracy(slack * engine.accuracy), bare, y)
    lists = [(_finite(phases), _graded(_finite(times))) for phases, times in meshes]
    longest = max(phases.size + times.size - 1 for phases, times in lists)
    replaced: list[Any] = [run.engine for run in residual.runs if run.engine is not None]
    # A mesh that is replaced has the least room already.
    rooms = [longest, *([each.mesh.ends.size for each in replaced] or [_least_size(residual.oscillator.friction)])]
    if slack > 1:
        finest = _meshes(engine.checking(), bare, y)
        steps = max(sum(np.isfinite(ends).sum() for ends in pair) for pair in finest)
        rooms.append(min(int(_MORE * steps), _SIZES[-1]))
    size = next(size for size in _SIZES if size >= max(rooms))
    return residual.with_runs(engine=[engine.on_mesh(*pair, size) for pair in lists])


def likely(residual: Residual, y: Any) -> Residual | None:
    """The residual with meshes of the size that is likely and nothing in them, before the first mesh can be made.

    What is compiled for it meanwhile is what a first fit waits for longest. None where a mesh is at hand without
    compiling; an engine that needs no mesh is likely as it is.
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
    """Room that the meshes of a law mostly need, and all get, so that its fits compile one size.

    One smooth state needs the first size; several states, switches, or steps that are finer than usual, the second.
    Where a law switches by more than its moving states, as Leuven's does on its return to steady sliding, the third.
    """
    moving = law.n_states - law.n_modes
    switches = jax.eval_shape(law.switches, *(jax.ShapeDtypeStruct(n, float) for n in ((), (law.n_states,), ()))).size
    return _SIZES[2 if switches > moving else 1 if (moving + switches) * law.step_refinement > 1 else 0]


def _bare(residual: Residual) -> Residual:
    """Of the samples only the last instant matters, so that records of any length share the compilation.

    An input of a rig moves the motion by so little that no step need be another one.
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
    """The steps of a list; one that is not finite from its first step on gets one, over which it is not finite either.

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
    # A step of no length has no rates.
    return np.unique(known[np.isfinite(known)])


def _graded(mesh: np.ndarray) -> np.ndarray:
    """Cut every step that is more than four times as long as its neighbour, until none is."""
    while True:
        h = np.diff(mesh)
        shorter = np.minimum(np.r_[h[1:], np.inf], np.r_[np.inf, h[:-1]])
        long = np.flatnonzero(h > _GROWTH * shorter * (1 + 1e-9))
        if not long.size:
            return mesh
        mesh = np.sort(np.concatenate([mesh, mesh[long] + h[long] / 2]))
