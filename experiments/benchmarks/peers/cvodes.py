"""Peer: CVODES through CasADi, with forward sensitivities as Jacobian.

The fit uses SciPy's least_squares. Every state has its own scale. The Jacobian only steers the steps, so its tolerance
is looser than that of the residual.
"""

import functools
from typing import Any

import casadi as ca
import numpy as np
from record import Record
from rig import LOAD, MASS, NOISE, SIGMA1, V_S

from peers.least_squares import Outcome, minimise

TOLERANCE = 3e-12
STEERING = 1e-6


def equations(law: str) -> tuple[Any, Any, Any]:
    """Return states, parameters and rates as CasADi expressions.

    The states are x/x0, v/x0 [80/s] and z/(F_c/sigma0). The parameters have the order of the record's names.
    """
    lugre = law == "lugre"
    y, p = ca.SX.sym("y", 3 if lugre else 2), ca.SX.sym("p", 5)
    x0, force, speed = p[4] if lugre else p[3], p[0] * LOAD, 80 * y[1]
    if lugre:
        creep = speed - ca.fabs(speed) * y[2]
        friction, rest = force * y[2] / x0 + SIGMA1 * creep, [creep * x0 * p[3] / force]
    else:
        friction, rest = force / x0 * ca.tanh(x0 * speed / V_S), []
    pull = -(p[2] * y[0] + p[1] * speed + friction) / (80 * MASS)
    return y, p, ca.vertcat(speed, pull, *rest)


# Building the integrators takes a while, so they are cached.
@functools.cache
def integrators(law: str, samples: int, step: float) -> tuple[Any, Any]:
    """Build the solver of the states and that of their five sensitivities."""
    y, p, rates = equations(law)
    options = {"max_num_steps": 10**6, "disable_internal_warnings": True}

    def made(tolerance: float) -> Any:
        tolerances = {"reltol": tolerance, "abstol": tolerance}
        grid = step * np.arange(samples)
        return ca.integrator("flow", "cvodes", {"x": y, "p": p, "ode": rates}, 0.0, grid, options | tolerances)

    return made(TOLERANCE), made(STEERING).forward(5)


def prepared(record: Record) -> tuple[Any, Any, np.ndarray]:
    """Return both solvers and the scaled state at the release."""
    start = np.array([1.0, 0.0, 1.0] if record.law == "lugre" else [1.0, 0.0])
    return *integrators(record.law, record.t.size, float(record.t[1])), start


def displacement(record: Record, p: np.ndarray) -> np.ndarray:
    """Compute the displacement [m] without offset, shape (n,)."""
    states, _, start = prepared(record)
    return p[record.names.index("x0")] * np.asarray(states(x0=start, p=p)["xf"])[0]


def slopes(record: Record, p: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Compute derivatives of the displacement by the parameters, shape (n, 5).

    `x` is the displacement at the parameters `p`.
    """
    _, sensitivities, start = prepared(record)
    at = record.names.index("x0")
    # Seeds of the size of the parameters make the sensitivities of order one, as the tolerances expect.
    seeds = np.diag(np.where(p == 0, 1.0, p))
    found = np.asarray(sensitivities(x0=start, p=p, fwd_p=seeds)["fwd_xf"])[0].reshape(5, -1)
    by = (p[at] * found / np.diag(seeds)[:, None]).T
    by[:, at] += x / p[at]
    if "offset" in record.names:
        by[:, record.names.index("offset")] = 1.0
    return by


def simulate(record: Record) -> np.ndarray:
    """Simulate the displacement [m] at the true values."""
    return displacement(record, np.array([record.truth[name] for name in record.names]))


def fit(record: Record) -> Outcome:
    """Fit the free parameters, with a Jacobian at each accepted step."""
    solved: dict[bytes, np.ndarray] = {}

    def residual(p: np.ndarray) -> np.ndarray:
        solved[p.tobytes()] = displacement(record, p)
        offset = p[-1] if "offset" in record.names else 0.0
        return (solved[p.tobytes()] + offset - record.x) / NOISE

    return minimise(residual, record, jacobian=lambda p: slopes(record, p, solved[p.tobytes()]) / NOISE, difference=0.0)
