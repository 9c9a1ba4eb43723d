"""The jobs by fricjax, each called as a user would call it."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from peers.least_squares import Outcome  # noqa: E402
from record import Record  # noqa: E402
from rig import DAMPING, LOAD, MASS, NOISE, SIGMA1, STIFFNESS, V_S, X0  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax.estimation.loss import named_loss  # noqa: E402
from fricjax.fitting.chunks import WIDTH  # noqa: E402
from fricjax.fitting.parameters import Request  # noqa: E402
from fricjax.fitting.problem import Problem, build_problem  # noqa: E402
from fricjax.fitting.rest import solve_with_rest  # noqa: E402
from fricjax.fitting.solve import Solution, solve_batch  # noqa: E402

PAPER = fj.Oscillator(1.0, 5000.0, 0.0, 9.81, fj.friction.Coulomb(0.1))
SLIDING = fj.Oscillator(MASS, STIFFNESS, DAMPING, 9.66, fj.friction.Stribeck(0.05, 0.065, v_stribeck=5e-3))


def machine(law: str, p: dict[str, float]) -> fj.Oscillator:
    """Build the prototype rig with given values."""
    friction = {
        "coulomb": lambda: fj.friction.Coulomb(p["mu"]),
        "tanh": lambda: fj.friction.Tanh(p["mu"], V_S),
        "lugre": lambda: fj.friction.LuGre(p["mu"], sigma0=p["sigma0"], sigma1=SIGMA1),
    }[law]()
    return fj.Oscillator(MASS, p["stiffness"], p["damping"], LOAD, friction)


def parts(record: Record) -> tuple[fj.Trace, dict[str, Any]]:
    """Return a bare trace and the settings of its fit."""
    run = [name for name in record.names if name in ("x0", "offset")]
    free = [name for name in record.names if name not in run]
    guess = {name: record.start[name] for name in record.names}
    how = {"oscillator": machine(record.law, record.start), "free": free, "nuisance": run}
    return fj.Trace(record.t, record.x, sigma=NOISE), how | {"start": "release", "guess": guess}


def fit(record: Record) -> Outcome:
    """Fit a record by the whole call.

    It includes checks, noise, segmentation, fit, check by another solution, covariance and report.
    """
    measured, how = parts(record)
    found = fj.fit(measured, **how, throw=False)
    return Outcome({name: found.values[name] for name in record.names}, found.passes)


def solver(records: list[Record]) -> Callable[[], list[Outcome]]:
    """Build a job that only solves problems built beforehand.

    It runs Levenberg-Marquardt from the standard start, and the check by another solution.
    """
    problems = [_posed(record) for record in records]
    if len(problems) == 1:
        return lambda: [_outcome(records[0], *solve_with_rest(problems[0]))]
    blocks = [slice(first, first + WIDTH) for first in range(0, len(problems), WIDTH)]

    def block(part: slice) -> list[Outcome]:
        solutions = zip(records[part], problems[part], solve_batch(problems[part]), strict=True)
        return [_outcome(r, p, solution) for r, p, (solution, _) in solutions]

    def solve() -> list[Outcome]:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return [outcome for some in pool.map(block, blocks) for outcome in some]

    return solve


def _posed(record: Record) -> Problem:
    measured, how = parts(record)
    empty: dict[str, Any] = {"engine": "auto", "bounds": {}, "priors": {}, "tie": {}, "rig": None}
    return build_problem((measured,), Request(**(empty | how), loss=named_loss("squares")))


def _outcome(record: Record, problem: Problem, solved: Solution) -> Outcome:
    values = dict(zip(problem.names, map(float, solved.derived.values), strict=True))
    return Outcome({name: values[name] for name in record.names}, solved.passes)


def fit_all(records: list[Record]) -> list[Outcome]:
    """Fit an archive in one call, each run from its standard start."""
    measured, how = zip(*map(parts, records), strict=True)
    names = records[0].names
    guess = {name: np.array([each["guess"][name] for each in how]) for name in names}
    found = fj.fit_batch(measured, **(how[0] | {"guess": guess}))
    return [
        Outcome({name: float(found.values[name][i]) for name in names}, int(found.passes[i]))
        for i in range(len(records))
    ]


def simulate(record: Record, engine: str = "auto") -> np.ndarray:
    """Simulate the displacement [m] at the true values, with default accuracy."""
    return np.asarray(fj.simulate(machine(record.law, record.truth), record.x0, record.t, engine=engine).x)


def sliding(ts: np.ndarray) -> np.ndarray:
    """Simulate the `sliding` workload [m], to 1e-10 m."""
    return np.asarray(fj.simulate(SLIDING, X0, ts, engine="hybrid", accuracy=1e-10).x)


_final = jax.jit(jax.vmap(lambda x0: fj.final_displacement(PAPER, x0)))


def final_displacements(x0: np.ndarray) -> np.ndarray:
    """Compute the triangle wave of final displacements [m]."""
    return np.asarray(_final(jnp.asarray(x0)))
