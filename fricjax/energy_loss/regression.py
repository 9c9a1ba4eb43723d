"""Friction coefficients by linear regression of the energy loss.

Along a half-cycle the energy falls by ``sum_j theta_j int phi_j(|v|) |v| dt`` and the known losses. The coefficients
theta of the candidate forces phi enter linearly, and no acceleration is needed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import UsageError
from ..oscillator import Oscillator, ready
from ..pairs.result import Estimates
from ..rig import Rig
from .decay import decay, each_of, frictionless, with_losses
from .force_samples import force_samples
from .smoothing import Smoothed

# Energies per half-cycle; the full covariance of their noise is used.
NODES = 32
# Factor for shorter windows, which bias the velocity less; energy needs no acceleration.
SHORTENED = 0.5
UNITS = {"coulomb": "N", "stribeck": "N", "viscous": "N s/m", "quadratic": "N s^2/m^2"}


def integral_friction(
    records: Any,
    rig: Rig,
    no_contact: Any = None,
    *,
    v_stribeck: float | None = None,
) -> Estimates:
    """Fit the coefficients of a friction law that is linear in them.

    The law is ``F = coulomb + stribeck exp(-(v/v_stribeck)^2) + viscous |v| + quadratic v^2``.

    Args:
        records: a run, or a list of runs of one machine, each as for :func:`fricjax.fit`.
        rig: mass, restoring force, and the damping and drag to subtract; the fitted coefficients add to these.
        no_contact: a run without contact; its damping and drag replace those of the rig.
        v_stribeck: Stribeck velocity [m/s]; None: without the second term.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: records with too few half-cycles, or sampled unevenly.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> rig = fj.Rig.from_toml(files.rig)
        >>> round(fj.energy_loss.integral_friction(files.run, rig).values["coulomb"] / rig.normal_force.value, 4)
        0.02
    """
    ready()
    # The candidate forces as functions of the speed.
    shapes: dict[str, Callable[[np.ndarray], np.ndarray]] = {"coulomb": np.ones_like}
    if v_stribeck is not None:
        if not v_stribeck > 0:
            raise UsageError(f"v_stribeck must be a positive speed in m/s, got {v_stribeck!r}.")
        shapes["stribeck"] = lambda speed: np.exp(-((speed / v_stribeck) ** 2))
    shapes |= {"viscous": np.abs, "quadratic": np.square}
    oscillator = frictionless(with_losses(rig, no_contact))
    samples, notes = each_of(records, lambda record: force_samples(decay(record), oscillator, lengthened=SHORTENED))
    equations = []
    for i, of_record in enumerate(samples):
        column = np.arange(len(samples)) == i
        equations += [_equation(part, of_record.offset, oscillator, shapes, column) for part in of_record.smoothed]
    size = len(shapes)
    inverse = np.linalg.inv(sum(work.T @ work for work, _, _ in equations))
    values = inverse @ sum(work.T @ lost for work, lost, _ in equations)
    middle = sum(work.T @ covariance @ work for work, _, covariance in equations)
    chi2 = sum(float(np.sum((lost - work @ values) ** 2)) for work, lost, _ in equations)
    expected = sum(float(np.trace(covariance)) for _, _, covariance in equations)
    units = {name: UNITS[name] for name in shapes}
    spread = (inverse @ middle @ inverse)[:size, :size]
    return Estimates.of(units, values[:size], spread, chi2 / expected, notes)


def _equation(
    smoothed: Smoothed,
    offset: float,
    oscillator: Oscillator,
    shapes: dict[str, Callable[[np.ndarray], np.ndarray]],
    column: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return work of the candidates, energy lost, and covariance, at each node.

    All are in units of the noise and relative to an unknown energy at the start. The last columns are the effect of a
    shift of the equilibrium of each record, the restoring force times the shift, in the `column` of this record.
    """
    from scipy.integrate import cumulative_simpson

    mass, damping, drag = (float(getattr(oscillator, name)) for name in ("mass", "damping", "drag"))
    x, v, speed = smoothed.x - offset, smoothed.v, smoothed.half_cycle.direction * smoothed.v
    restoring = np.asarray(oscillator.restoring_force(x))  # pyright: ignore[reportArgumentType]
    potential = np.asarray(oscillator.restoring.potential(x, oscillator.stiffness))  # pyright: ignore[reportArgumentType]
    known = (damping + drag * np.abs(v)) * v**2
    powers = np.column_stack([*(shape(speed) * speed for shape in shapes.values()), known])
    nodes = np.unique(np.linspace(0, x.size - 1, NODES).astype(int))
    work = cumulative_simpson(powers, dx=smoothed.half_cycle.step, axis=0, initial=0.0)[nodes]
    lost = -(mass * v**2 / 2 + potential)[nodes] - work[:, -1]
    picked = np.eye(x.size)[:, nodes]
    weights = restoring[:, None] * picked, (mass * v)[:, None] * picked, 0 * picked
    response = smoothed.response(weights)
    covariance = smoothed.half_cycle.noise**2 * response.T @ response
    std = np.sqrt(np.diag(covariance))
    # The energy at the start is unknown, so project the equations on the space that does not depend on it.
    start = (1 / std) / np.linalg.norm(1 / std)
    keep = (np.eye(std.size) - np.outer(start, start)) / std
    columns = np.column_stack([work[:, :-1], restoring[nodes, None] * column])
    return keep @ columns, keep @ lost, keep @ covariance @ keep.T
