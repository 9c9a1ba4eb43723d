"""Coefficients of friction by linear regression of the energy on the work of candidate forces.

Along a stroke the energy falls by ``sum_j theta_j int phi_j(|v|) |v| dt`` and the known losses. The coefficients theta
enter linearly, and no acceleration is needed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import UsageError
from ..oscillator import Oscillator, ready
from ..pairs.result import Estimates
from ..rig import Rig
from .decay import decay, each_of
from .force_samples import sampled
from .no_contact import contactless
from .smoothing import Motion

NODES = 32  # energies looked at per stroke
SHORTENED = 0.5  # windows: energy needs no acceleration, and shorter ones bias the velocity less
UNITS = {"coulomb": "N", "stribeck": "N", "viscous": "N s/m", "quadratic": "N s^2/m^2"}


def integral_friction(
    records: Any,
    rig: Rig,
    no_contact: Any = None,
    *,
    v_stribeck: float | None = None,
) -> Estimates:
    """Coefficients of ``F = coulomb + stribeck exp(-(v/v_stribeck)^2) + viscous |v| + quadratic v^2``.

    Args:
        records: a run, or a list of runs of one machine, each given as to :func:`fricjax.fit`.
        rig: mass, restoring force, and the damping and drag to subtract; what is found comes on top of them.
        no_contact: a run without contact, from which damping and drag are fitted in place of those of the rig.
        v_stribeck: Stribeck velocity [m/s]; None: without the second term.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: records with too few half-cycles, or sampled unevenly.

    ```python
    fricjax.energy_loss.integral_friction(["run1.csv", "run2.csv"], rig).values["coulomb"]
    ```
    """
    ready()
    shapes = _shapes(v_stribeck)
    oscillator = contactless(rig, no_contact)
    found, notes = each_of(records, lambda record: sampled(decay(record), oscillator, lengthened=SHORTENED))
    equations = []
    for i, forces in enumerate(found):
        own = np.arange(len(found)) == i
        equations += [_equation(motion, forces.offset, oscillator, shapes, own) for motion in forces.motions]
    size = len(shapes)
    inverse = np.linalg.inv(sum(work.T @ work for work, _, _ in equations))
    values = inverse @ sum(work.T @ lost for work, lost, _ in equations)
    middle = sum(work.T @ covariance @ work for work, _, covariance in equations)
    chi2 = sum(float(np.sum((lost - work @ values) ** 2)) for work, lost, _ in equations)
    expected = sum(float(np.trace(covariance)) for _, _, covariance in equations)
    units = {name: UNITS[name] for name in shapes}
    spread = (inverse @ middle @ inverse)[:size, :size]
    return Estimates.of(units, values[:size], spread, chi2 / expected, notes)


def _shapes(v_stribeck: float | None) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """The candidate forces as functions of the speed."""
    shapes = {"coulomb": np.ones_like, "viscous": np.abs, "quadratic": np.square}
    if v_stribeck is None:
        return shapes
    if not v_stribeck > 0:
        raise UsageError(f"v_stribeck must be a positive speed in m/s, got {v_stribeck!r}.")
    return {"coulomb": np.ones_like, "stribeck": lambda speed: np.exp(-((speed / v_stribeck) ** 2)), **shapes}


def _equation(
    motion: Motion,
    offset: float,
    oscillator: Oscillator,
    shapes: dict[str, Callable[[np.ndarray], np.ndarray]],
    own: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Work of the candidates up to each node of a stroke, energy lost there, and the covariance of the energies.

    All in units of the noise, and without the energy at the start. The last columns are what a shift of the equilibrium
    of each record changes: the restoring force times the shift, in the record that `own` marks.
    """
    from scipy.integrate import cumulative_simpson

    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    x, v, speed = motion.x - offset, motion.v, motion.stroke.direction * motion.v
    restoring = np.asarray(oscillator.restoring_force(x))  # pyright: ignore[reportArgumentType]
    potential = np.asarray(oscillator.restoring.potential(x, oscillator.stiffness))  # pyright: ignore[reportArgumentType]
    known = (damping + drag * np.abs(v)) * v**2
    powers = np.column_stack([*(shape(speed) * speed for shape in shapes.values()), known])
    nodes = np.unique(np.linspace(0, x.size - 1, NODES).astype(int))
    work = cumulative_simpson(powers, dx=motion.stroke.step, axis=0, initial=0.0)[nodes]
    lost = -(mass * v**2 / 2 + potential)[nodes] - work[:, -1]
    picked = np.eye(x.size)[:, nodes]
    weights = restoring[:, None] * picked, (mass * v)[:, None] * picked, 0 * picked
    covariance = motion.stroke.noise**2 * (seen := motion.response(weights)).T @ seen
    std = np.sqrt(np.diag(covariance))
    start = (1 / std) / np.linalg.norm(1 / std)
    keep = (np.eye(std.size) - np.outer(start, start)) / std
    columns = np.column_stack([work[:, :-1], restoring[nodes, None] * own])
    return keep @ columns, keep @ lost, keep @ covariance @ keep.T
