"""The steps of the smooth engine during a fit: found once by an adaptive solve, then kept.

The mesh lives in scaled time, so it moves with the natural frequency while the fit runs. Neighbouring steps are made to
differ little in length and all of them are cut a little finer than the error asks for, so that the mesh still fits
when the parameters have moved; lengths of the list are rounded up, so that few shapes are compiled.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..data.errors import UsageError
from ..oscillator import Oscillator, Smooth
from .residual import Residual, start_of
from .sizes import rounded_up

CAPACITY = 1 << 17
_REACH = 1.05
_GROWTH = 4.0


def with_mesh(residual: Residual, y: Any, slack: float = 1.0) -> Residual:
    """The residual with its engine on a mesh made for coordinates `y`; unchanged for engines that need none.

    Runs of a joint fit share one mesh, the union of what each of them needs. `slack` is the factor by which its error
    may be larger than the engine's.

    Raises:
        UsageError: more steps than the list of them can hold.
    """
    if not isinstance(residual.engine, Smooth):
        return residual
    machine = residual.machine(y)
    engine, runs = residual.engine, residual.runs
    accuracy = slack * engine.accuracy
    meshes = [np.asarray(_steps(accuracy, machine, residual.own(y, i), run.t[-1])) for i, run in enumerate(runs)]
    if any(np.all(np.isfinite(mesh)) for mesh in meshes):
        raise UsageError(
            f"The motion needs more than {CAPACITY} steps of the smooth engine. Check the law's coefficients, or crop "
            "the record to its moving part."
        )
    merged = np.unique(np.concatenate([mesh[np.isfinite(mesh)] for mesh in meshes]))
    if merged.size == 1:
        # A motion that is not finite from its first step on gets one step, over which it is not finite either.
        merged = np.append(merged, merged + 1.0)
    mesh = jnp.asarray(_padded(_graded(merged)))
    return eqx.tree_at(lambda r: r.engine.mesh, residual, mesh, is_leaf=lambda x: x is None)


@eqx.filter_jit
def _steps(accuracy: Any, machine: Oscillator, at: dict[str, Array], end: Array) -> Array:
    start = start_of(machine, at)
    free = Smooth(accuracy=accuracy, max_steps=CAPACITY)
    return free.steps(machine, start, _REACH * (end - at["t_release"]), CAPACITY)


def _graded(mesh: np.ndarray) -> np.ndarray:
    """Cut every step that is more than four times as long as its neighbour, until none is."""
    while True:
        h = np.diff(mesh)
        shorter = np.minimum(np.r_[h[1:], np.inf], np.r_[np.inf, h[:-1]])
        long = np.flatnonzero(h > _GROWTH * shorter * (1 + 1e-9))
        if not long.size:
            return mesh
        mesh = np.sort(np.concatenate([mesh, mesh[long] + h[long] / 2]))


def lengthened(residual: Residual, steps: int) -> Residual:
    """The same residual with its mesh cut into `steps` steps, that it may share a compilation with a longer one."""
    if not isinstance(residual.engine, Smooth):
        return residual
    mesh = jnp.asarray(_filled(np.asarray(residual.engine.mesh), steps))
    return eqx.tree_at(lambda r: r.engine.mesh, residual, mesh)


def _padded(mesh: np.ndarray) -> np.ndarray:
    """Cut steps until their number is a power of two or a whole number of eighths of it."""
    return _filled(mesh, rounded_up(mesh.size - 1, 8))


def _filled(mesh: np.ndarray, steps: int) -> np.ndarray:
    """Halve the longest steps until there are as many as asked for."""
    while missing := steps - (mesh.size - 1):
        h = np.diff(mesh)
        longest = np.argsort(h)[::-1][:missing]
        mesh = np.sort(np.concatenate([mesh, mesh[longest] + h[longest] / 2]))
    return mesh
