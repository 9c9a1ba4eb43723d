"""Coefficients of friction by linear regression of the energy on the work of candidate forces.

Along a stroke the energy falls by ``sum_j theta_j int phi_j(|v|) |v| dt`` and the known losses. The coefficients theta
enter linearly, and no acceleration is needed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..calibrate import Rig
from ..data import Record, Trace
from ..data.errors import UsageError
from ..oscillator import Oscillator, require_x64
from .estimates import Estimates
from .no_contact import contactless
from .sampled import Sampled, sampled
from .strokes import decays

NODES = 32  # energies looked at per stroke
SHORTENED = 0.5  # windows: energy needs no acceleration, and shorter ones bias the velocity less
UNITS = {"coulomb": "N", "stribeck": "N", "viscous": "N s/m", "quadratic": "N s^2/m^2"}


def integral_friction(
    records: Any,
    rig: Rig,
    no_contact: Record | Trace | None = None,
    *,
    v_stribeck: float | None = None,
) -> Estimates:
    """Coefficients of ``F = coulomb + stribeck exp(-(v/v_stribeck)^2) + viscous |v| + quadratic v^2``.

    Args:
        records: a record or trace, or several of one machine.
        rig: mass, restoring force, and the damping and drag to subtract; what is found comes on top of them.
        no_contact: a run without contact, from which damping and drag are fitted in place of those of the rig.
        v_stribeck: Stribeck velocity [m/s]; None: without the second term.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: records with too few half-cycles, or sampled unevenly.
    """
    require_x64()
    shapes = _shapes(v_stribeck)
    oscillator = contactless(rig, no_contact)
    found, notes = decays(records)
    equations = [_equations(sampled(decay, oscillator, lengthened=SHORTENED), oscillator, shapes) for decay in found]
    inverse = np.linalg.inv(sum(work.T @ work for work, _, _ in equations))
    values = inverse @ sum(work.T @ lost for work, lost, _ in equations)
    middle = sum(work.T @ covariance @ work for work, _, covariance in equations)
    chi2 = sum(float(np.sum((lost - work @ values) ** 2)) for work, lost, _ in equations)
    expected = sum(float(np.trace(covariance)) for _, _, covariance in equations)
    units = {name: UNITS[name] for name in shapes}
    return Estimates.of(units, values, inverse @ middle @ inverse, chi2 / expected, notes)


def _shapes(v_stribeck: float | None) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """The candidate forces as functions of the speed."""
    shapes = {"coulomb": np.ones_like, "viscous": np.abs, "quadratic": np.square}
    if v_stribeck is None:
        return shapes
    if not v_stribeck > 0:
        raise UsageError(f"v_stribeck must be a positive speed in m/s, got {v_stribeck!r}.")
    return {"coulomb": np.ones_like, "stribeck": lambda speed: np.exp(-((speed / v_stribeck) ** 2)), **shapes}


def _equations(
    found: Sampled, oscillator: Oscillator, shapes: dict[str, Callable[[np.ndarray], np.ndarray]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Work of the candidates up to each node, energy lost there, and the covariance of the energies.

    All in units of the noise, and without what belongs to the record alone: the energy at the start of each stroke, and
    the equilibrium, which changes the energy by the restoring force.
    """
    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    restoring = np.asarray(oscillator.restoring_force(found.x))  # pyright: ignore[reportArgumentType]
    potential = oscillator.restoring.potential(found.x, oscillator.stiffness)  # pyright: ignore[reportArgumentType]
    energy = mass * found.v**2 / 2 + np.asarray(potential)
    known = (damping + drag * np.abs(found.v)) * found.v**2
    powers = np.column_stack([*(shape(found.speed) * found.speed for shape in shapes.values()), known])
    nodes, strokes, work = _at_nodes(found, powers)
    picked = np.zeros((energy.size, nodes.size))
    picked[nodes, np.arange(nodes.size)] = 1.0
    covariance = found.covariance(picked, (restoring, mass * found.v, np.zeros_like(energy)))
    std = np.sqrt(np.diag(covariance))
    own = np.column_stack([strokes[:, None] == np.unique(strokes), restoring[nodes]]) / std[:, None]
    ortho = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    keep = (np.eye(std.size) - ortho @ ortho.T) / std
    return keep @ work[:, :-1], keep @ (-energy[nodes] - work[:, -1]), keep @ covariance @ keep.T


def _at_nodes(found: Sampled, powers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples at the nodes, the number of their stroke, and the integrals of the powers from its start."""
    from scipy.integrate import cumulative_simpson

    nodes, strokes, works, first = [], [], [], 0
    for i, motion in enumerate(found.motions):
        size = motion.x.size
        chosen = np.unique(np.linspace(0, size - 1, NODES).astype(int))
        work = cumulative_simpson(powers[first : first + size], dx=motion.stroke.step, axis=0, initial=0.0)
        nodes.append(first + chosen)
        strokes.append(np.full(chosen.size, i))
        works.append(work[chosen])
        first += size
    return np.concatenate(nodes), np.concatenate(strokes), np.concatenate(works)
