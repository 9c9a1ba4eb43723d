"""SciPy's least_squares in scaled coordinates, for most peers.

Only the stock peer has another solver.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from record import Record
from scipy.optimize import least_squares

# Typical size of the parameters that start at zero.
TYPICAL = {"offset": 1e-6}


class Outcome(NamedTuple):
    """Fitted values by name, and the number of model solves."""

    values: dict[str, float]
    solves: int


def minimise(
    residual: Callable[[np.ndarray], np.ndarray],
    record: Record,
    *,
    difference: float,
    jacobian: Callable[[np.ndarray], np.ndarray] | None = None,
    ftol: float = 1e-8,
) -> Outcome:
    """Run Levenberg-Marquardt from the standard start, in scaled parameters.

    Args:
        residual: function of the parameters in SI units, in the order of the record's names.
        record: record with the standard start.
        difference: step of the finite differences, in units of the start values.
        jacobian: derivatives of the residual by the parameters in SI units, shape (n, p); None: finite differences.
        ftol: relative change of chi^2 at which to stop.
    """
    start = np.array([record.start[name] for name in record.names])
    scale = np.array([record.start[name] or TYPICAL[name] for name in record.names])
    solves = 0

    def scaled(q: np.ndarray) -> np.ndarray:
        nonlocal solves
        solves += 1
        return residual(q * scale)

    slopes: dict[str, Any] = (
        {"jac": lambda q: jacobian(q * scale) * scale}
        if jacobian
        else {"diff_step": difference / np.maximum(start / scale, difference)}
    )
    found = least_squares(
        scaled, start / scale, method="lm", x_scale="jac", ftol=ftol, xtol=1e-12, gtol=1e-12, **slopes
    )
    return Outcome(dict(zip(record.names, map(float, found.x * scale), strict=True)), solves)
