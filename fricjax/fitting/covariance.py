"""Covariance of a fit: from the Jacobian at the optimum, and from the uncertain inputs of the rig to first order.

One singular value decomposition of the Jacobian, its columns scaled to one, gives the covariance, the rank and the
undetermined directions. An input ``b`` with standard uncertainty ``u(b)`` that is held fixed moves the optimum by
``dp/db = -(J'J)^-1 J' dr/db``; its share of the covariance is ``(dp/db) u(b)^2 (dp/db)'`` (JCGM 100, 5.1).
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..oscillator import Oscillator
from .problem import Problem
from .residual import Residual
from .solve import Solved

RANK_TOLERANCE = 1e-9


class Covariance(NamedTuple):
    """Covariances of the free parameters in their own units, shape (p, p).

    Attributes:
        statistical: from the scatter of the samples.
        combined: with the uncertainty of the rig's inputs.
        undetermined: parameters along a direction that the record does not determine, shape (p,).
        at_bound: parameters held at a bound, shape (p,).
        full_rank: whether every movable direction is determined.
    """

    statistical: np.ndarray
    combined: np.ndarray
    undetermined: np.ndarray
    at_bound: np.ndarray
    full_rank: bool


def covariance(problem: Problem, solved: Solved, variance: float, rig: Any) -> Covariance:
    """Covariance at the optimum; `variance` is the variance of a unit-weight residual."""
    jacobian = np.asarray(solved.jacobian)
    q, space = solved.q, problem.residual.space
    at_bound = np.asarray((q <= problem.lower) | (q >= problem.upper))
    inverse, undetermined = _pseudo_inverse(jacobian, ~at_bound)
    slope = np.asarray(space.slope(q))
    spread = slope[:, None] * inverse
    statistical = variance * spread @ spread.T
    combined = statistical.copy()
    for shift in _input_shifts(problem.residual, q, rig):
        moved = spread @ shift
        combined += np.outer(moved, moved)
    lost = undetermined | at_bound
    for matrix in (statistical, combined):
        matrix[lost, :] = matrix[:, lost] = 0.0
        matrix[lost, lost] = np.inf
    return Covariance(statistical, combined, undetermined, at_bound, not undetermined.any())


def _pseudo_inverse(jacobian: np.ndarray, movable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares inverse of the Jacobian among the movable parameters, and which of these it does not determine."""
    p = jacobian.shape[1]
    norms = np.where(movable, np.linalg.norm(jacobian, axis=0), 0.0)
    active = norms > 0
    inverse, undetermined = np.zeros((p, jacobian.shape[0])), movable & ~active
    if active.any():
        scaled = jacobian[:, active] / norms[active]
        u, s, vt = np.linalg.svd(scaled, full_matrices=False)
        weak = s < RANK_TOLERANCE * s[0]
        strong = np.where(weak, 0.0, 1 / np.where(weak, 1.0, s))
        inverse[active] = ((vt.T * strong) @ u.T) / norms[active][:, None]
        undetermined[active] |= np.any(np.abs(vt[weak]) > 1e-3, axis=0)
    return inverse, undetermined


def _input_shifts(residual: Residual, q: Array, rig: Any) -> list[np.ndarray]:
    """Change of the residual for one standard uncertainty of each of the rig's inputs, times -1."""
    if rig is None:
        return []
    inputs: Mapping[str, Any] = rig.inputs()
    law = residual.oscillator.friction
    shifts = []
    for name, measured in inputs.items():
        value = jnp.asarray(float(measured.value))

        def machine(b: Array, name: str = name) -> Oscillator:
            return rig.with_inputs({name: b}).oscillator(law)

        _, tangent = jax.jvp(machine, (value,), (jnp.asarray(float(measured.std)),))
        shifts.append(-np.asarray(_directional(residual, q, tangent)))
    return shifts


@eqx.filter_jit
def _directional(residual: Residual, q: Array, tangent: Oscillator) -> Array:
    """Derivative of the residual when the fixed coefficients of the machine move along `tangent`."""

    def moved(oscillator: Oscillator) -> Array:
        return eqx.tree_at(lambda r: r.oscillator, residual, oscillator)(q)

    return jax.jvp(moved, (residual.oscillator,), (tangent,))[1]
