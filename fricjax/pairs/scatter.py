"""What the scatter of few residuals is worth: the scale of standard errors, and Student's t for their intervals."""

from typing import NamedTuple

import numpy as np

from ..estimation.covariance import COVERAGE

# Level at which residuals contradict the noise that was stated, and that of an interval.
_CONTRADICTED, _LEVEL = 0.05, 0.95


class Scale(NamedTuple):
    """How uncertain a fit of few residuals is.

    Attributes:
        factor: by which the standard errors at the stated noise are to be multiplied, inf where nothing tells.
        half_width: of a 95 % interval in these standard errors.
        contradicted: whether the stated noise is too small for the residuals.
    """

    factor: float
    half_width: float
    contradicted: bool


def scale_of(chi2: float, dof: int, known: bool) -> Scale:
    """Scale of the standard errors of a fit of `dof` degrees of freedom, whose noise is `known` or in its residuals.

    Stated noise that is too small for the residuals is enlarged to them (Birge's ratio, Phys. Rev. 40, 207, 1932); as
    its size then comes from few residuals, as where none was stated, the interval is Student's.
    """
    from scipy.stats import chi2 as squares

    if dof < 1:
        return Scale(1.0 if known else np.inf, COVERAGE, False)
    ratio = float(np.sqrt(chi2 / dof))
    contradicted = known and bool(squares.sf(chi2, dof) < _CONTRADICTED)
    half_width = COVERAGE if known and not contradicted else student(dof)
    return Scale(max(ratio, 1.0) if known else ratio, half_width, contradicted)


def student(dof: float) -> float:
    """Half-width of a 95 % interval in standard errors that come from `dof` degrees of freedom, inf for none."""
    from scipy.stats import t

    return float(t.ppf((1 + _LEVEL) / 2, dof)) if dof > 0 else np.inf
