"""Jobs of each method for each workload, as functions for repeated calls."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from record import load

# Module of each method, by its name in the table.
METHODS = {
    "fricjax": "ours",
    "fricjax, solve only": "ours",
    "numba closed form": "peers.closed_form",
    "numba closed form, own Jacobian": "peers.closed_form_jacobian",
    "numba RK4": "peers.rk4",
    "CVODES": "peers.cvodes",
    "odeint": "peers.lsoda",
    "stock optimistix": "peers.stock",
    "stock optimistix, one by one": "peers.stock",
    "DOP853": "peers.dop853",
}
SLIDING_TIMES = np.arange(round(0.29842 * 20e3)) / 20e3
Job = Callable[[], Any]


def fits(method: str, path: Path) -> Job:
    """Build a job that fits all records in a file.

    The job returns a list of outcomes. If it is a pool of processes, the caller must close it.
    """
    from peers.pool import Pool

    module, records = importlib.import_module(METHODS[method]), load(path)
    if method.endswith("solve only"):
        return module.solver(records)
    if len(records) == 1:
        return lambda: [module.fit(records[0])]
    if hasattr(module, "fit_all") and not method.endswith("one by one"):
        return lambda: module.fit_all(records)
    return Pool(path, METHODS[method], len(records))


def displacements(workload: str, method: str, count: int) -> Job:
    """Build a job that returns displacements [m].

    It computes the map of `count` final displacements or one forward solve of `sliding`.
    """
    module = importlib.import_module(METHODS[method])
    if workload == "map":
        x0 = np.linspace(0.01e-3, 3e-3, count)
        return lambda: module.final_displacements(x0)
    return lambda: module.sliding(SLIDING_TIMES)
