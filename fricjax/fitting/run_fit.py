"""Numbers of the fits of a batch."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..data import Segmentation
from ..errors import UsageError
from .batch_result import BatchFit
from .derived import UNITS
from .diagnostics import optimum_found
from .noise import Noise
from .sketch import Sketch


class RunFit(NamedTuple):
    """Fit of one run; a rejected run has only a status.

    Attributes:
        status: the outcome in words.
        units: units of the free parameters by name, in order.
        inputs: names of the uncertain inputs of the rig.
        values: values of the parameters, with times of the record, shape (p,); `white`: their standard errors for white
            noise; `covariance`: shape (p, p).
        kinematics: values and standard errors of the quantities of `UNITS`, shape (q, 2).
        contributions: change of parameters and kinematics per standard uncertainty of each input of the rig, shape
            (p + q, inputs).
        flags: remarks by name of the parameter.
        warnings: warnings in sentences.
        chi2, dof, residual_rms, sigma, noise, numerical_shift, iterations, passes, engine: as in a `BatchFit`.
        half_cycles: number of half-cycles to the stop; -1 without one.
        segmentation: reversals, rest and noise of the record.
        load: normal force of the machine [N].
        sketch: returns some samples of record and residual; takes the number of samples, None for all.
    """

    status: str
    units: Mapping[str, str] = {}
    inputs: tuple[str, ...] = ()
    values: Any = None
    white: Any = None
    covariance: Any = None
    kinematics: Any = None
    contributions: Any = None
    flags: Mapping[str, tuple[str, ...]] = {}
    warnings: tuple[str, ...] = ()
    chi2: float = np.nan
    dof: float = np.nan
    residual_rms: float = np.nan
    sigma: float = np.nan
    noise: Noise | None = None
    numerical_shift: float = np.nan
    half_cycles: int = -1
    iterations: int = 0
    passes: int = 0
    engine: str = ""
    segmentation: Segmentation | None = None
    load: float = np.nan
    sketch: Callable[[int | None], Sketch] | None = None

    @property
    def rejected(self) -> bool:
        return self.values is None


def collected(rows: Sequence[RunFit], sources: tuple[str, ...]) -> BatchFit:
    """Collect the fits into columns.

    All runs must have the same free parameters and uncertain inputs.

    Raises:
        UsageError: no run could be fitted.
    """
    first = next((row for row in rows if not row.rejected), None)
    if first is None:
        raise UsageError(f"No run could be fitted. The first was {rows[0].status}")
    names, p, q = tuple(first.units), len(first.units), len(UNITS)

    def column(name: str, *shape: int) -> np.ndarray:
        absent = np.full(shape, np.nan)
        return np.array([absent if row.rejected else getattr(row, name) for row in rows])

    def by_name(values: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(names, values.T, strict=True))

    covariances, trace = column("covariance", p, p), column("kinematics", q, 2)
    shares = column("contributions", p + q, len(first.inputs))
    return BatchFit(
        names=names,
        values=by_name(column("values", p)),
        std_errors=by_name(np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))),
        white_std_errors=by_name(column("white", p)),
        covariance=covariances,
        units=dict(first.units),
        converged=np.array([optimum_found(row.status) for row in rows]),
        status=tuple(row.status for row in rows),
        flags=tuple(dict(row.flags) for row in rows),
        warnings=tuple(row.warnings for row in rows),
        kinematics={name: trace[:, i, 0] for i, name in enumerate(UNITS)},
        kinematics_std={name: trace[:, i, 1] for i, name in enumerate(UNITS)},
        contributions={
            name: {source: shares[:, i, j] for j, source in enumerate(first.inputs)}
            for i, name in enumerate((*names, *UNITS))
        },
        noises=tuple(row.noise for row in rows),
        engine=first.engine,
        sources=sources,
        **{name: np.array([getattr(row, name) for row in rows]) for name in _NUMBERS},
    )


_NUMBERS = ("chi2", "dof", "residual_rms", "sigma", "numerical_shift", "half_cycles", "iterations", "passes")
