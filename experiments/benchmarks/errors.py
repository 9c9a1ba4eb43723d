"""Largest numerical error of each engine and peer on each workload.

Errors refer to the reference solutions.
"""

import importlib
from collections.abc import Iterator

import jobs
import numpy as np
import ours
import reference
import workloads
from peers import dop853
from record import Record
from rig import X0

ENGINES = {"coulomb": ("exact", "hybrid"), "tanh": ("hybrid", "smooth"), "lugre": ("smooth",)}
PEERS = {
    "coulomb": ("numba closed form",),
    "tanh": ("numba RK4", "CVODES", "odeint", "stock optimistix"),
    "lugre": ("CVODES", "odeint"),
}
NAMES = {"coulomb": "rolling-exact", "tanh": "rolling", "lugre": "rolling-lugre"}
# Extreme runs of the archives: coefficient of friction [1] and initial displacement [m].
CORNERS = ((0.005, 0.5e-3), (0.005, 3e-3), (0.02, 0.5e-3), (0.02, 3e-3))


def table(duration: float) -> Iterator[tuple[str, str, float]]:
    """Yield workload, method, and error [nm]."""
    for law, name in NAMES.items():
        for method, error in _errors(workloads.record(law, duration=duration)):
            yield name, method, error
    for law in ("coulomb", "tanh"):
        corners = [workloads.record(law, mu=mu, x0=x0, duration=duration) for mu, x0 in CORNERS]
        worst: dict[str, float] = {}
        for record in corners:
            for method, error in _errors(record):
                worst[method] = max(worst.get(method, 0.0), error)
        yield from ((f"archive ({law.capitalize()})", method, error) for method, error in worst.items())
    yield from _sliding()
    yield from _map()


def _errors(record: Record) -> Iterator[tuple[str, float]]:
    truth = exact(record)
    for engine in ENGINES[record.law]:
        yield engine, _nm(ours.simulate(record, engine), truth)
    for peer in PEERS[record.law]:
        yield peer, _nm(importlib.import_module(jobs.METHODS[peer]).simulate(record), truth)


def exact(record: Record) -> np.ndarray:
    """Compute the reference at the true values [m].

    For Tanh this is DOP853 itself, without the faster numba loop.
    """
    if record.law == "tanh":
        return reference.tanh(record.t, record.truth)
    return reference.displacement(record.law, record.t, record.truth, record.half_cycles)


def _sliding() -> Iterator[tuple[str, str, float]]:
    times = jobs.SLIDING_TIMES
    truth = dop853.displacement(dop853.SLIDING, X0, times, 1e-12)
    yield "sliding", "hybrid", _nm(ours.sliding(times), truth)
    yield "sliding", "DOP853", _nm(dop853.sliding(times), truth)


def _map() -> Iterator[tuple[str, str, float]]:
    x0 = np.linspace(0.01e-3, 3e-3, 100)
    band = dop853.PAPER.static / dop853.PAPER.stiffness
    # Without damping each half-cycle reduces the amplitude by 2 x_d, until the mass stays.
    strokes = np.ceil(np.maximum(x0 - band, 0) / (2 * band) - 1e-9)
    truth = (-1) ** strokes * (x0 - 2 * band * strokes)
    yield "map", "exact", _nm(ours.final_displacements(x0), truth)
    yield "map", "DOP853", _nm(dop853.final_displacements(x0), truth)


def _nm(found: np.ndarray, truth: np.ndarray) -> float:
    return 1e9 * float(np.max(np.abs(found - truth)))
