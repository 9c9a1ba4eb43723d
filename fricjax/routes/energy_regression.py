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
    equations = [_equations(sampled(decay, oscillator), oscillator, shapes) for decay in found]
    weighted = [_weighted(*equation) for equation in equations]
    normal = sum(basis.T @ basis for basis, _, _ in weighted)
    inverse = np.linalg.inv(normal)
    values = inverse @ sum(basis.T @ right for basis, right, _ in weighted)
    middle = sum(basis.T @ covariance @ basis for basis, _, covariance in weighted)
    chi2 = sum(float(np.sum((right - basis @ values) ** 2)) for basis, right, _ in weighted)
    freedom = sum(right.size for _, right, _ in weighted) - values.size
    units = {name: UNITS[name] for name in shapes}
    return Estimates.of(units, values, inverse @ middle @ inverse, chi2 / freedom, notes)


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
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Work done by the candidates up to each node, energy lost there, covariance of the energies, and the strokes."""
    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    slope = np.asarray(oscillator.restoring_force(found.x))  # pyright: ignore[reportArgumentType]
    potential = np.asarray(oscillator.restoring.potential(found.x, oscillator.stiffness))  # pyright: ignore[reportArgumentType]
    energy = mass * found.v**2 / 2 + potential
    known = (damping + drag * np.abs(found.v)) * found.v**2
    powers = np.column_stack([*(shape(found.speed) * found.speed for shape in shapes.values()), known])
    works, nodes, strokes, first = [], [], [], 0
    for i, motion in enumerate(found.motions):
        own = slice(first, first + motion.x.size)
        steps = motion.stroke.step * (powers[own][1:] + powers[own][:-1]) / 2
        chosen = np.unique(np.linspace(0, motion.x.size - 1, NODES).astype(int))
        works.append(np.vstack([np.zeros(powers.shape[1]), np.cumsum(steps, axis=0)])[chosen])
        nodes.append(first + chosen)
        strokes.append(np.full(chosen.size, i))
        first += motion.x.size
    at, work = np.concatenate(nodes), np.concatenate(works)
    picked = np.zeros((energy.size, at.size))
    picked[at, np.arange(at.size)] = 1.0
    covariance = found.covariance(picked, (slope, mass * found.v, np.zeros_like(energy)))
    return work[:, :-1], -energy[at] - work[:, -1], covariance, np.concatenate(strokes)


def _weighted(
    work: np.ndarray, lost: np.ndarray, covariance: np.ndarray, strokes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Basis, right-hand side and covariance in units of the noise, without the unknown energy at each stroke's start."""
    std = np.sqrt(np.diag(covariance))
    starts = (strokes[:, None] == np.unique(strokes)) / std[:, None]
    ortho = np.linalg.qr(starts)[0]
    keep = np.eye(std.size) - ortho @ ortho.T
    return keep @ (work / std[:, None]), keep @ (lost / std), keep @ (covariance / np.outer(std, std)) @ keep
