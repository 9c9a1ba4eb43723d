"""What the scatter of few residuals is worth, and what a reader of coefficients from pairs must know."""

from typing import NamedTuple

import numpy as np

from ..estimation.covariance import COVERAGE
from ..oscillator import Oscillator
from ..show import engineering
from .displacements import Pairs
from .unwrapping import OPEN, Unwrapped

# Level at which residuals contradict the noise that was stated, and that of an interval: both conventions.
_CONTRADICTED, _LEVEL = 0.05, 0.95
# Odds of another dead band at which a fit is not valid: one in twenty, as its intervals promise.
_INVALID = 0.05


class Scale(NamedTuple):
    """How uncertain a fit of few residuals is.

    Attributes:
        factor: by which the standard errors at the stated noise are to be multiplied, inf where no residual is left.
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


def status_of_counts(counts: Unwrapped) -> str | None:
    """What is wrong with a fit whose numbers of half-cycles are open; None where they are not."""
    if counts.odds <= _INVALID:
        return None
    return "open: the pairs agree with several dead bands. Give the numbers of half-cycles, or add pairs."


def count_warnings(pairs: Pairs, counts: Unwrapped) -> list[str]:
    """Sentences on numbers of half-cycles that the pairs leave open."""
    warnings = []
    if counts.odds > OPEN:
        warnings.append(
            f"The {pairs.x0.size} pairs may belong to another dead band than {engineering(counts.dead_band, 'm')}, at "
            f"odds of about {min(counts.odds, 1.0):.1g} to 1. Give their numbers of half-cycles as half_cycles, or add "
            "pairs."
        )
    if counts.doubtful:
        warnings.append(
            f"One half-cycle more or less leads {counts.doubtful} pair(s) as near to their ends, which lie at the edge "
            "of the dead band or alone determine the offset. Give their numbers of half-cycles as half_cycles."
        )
    return warnings


def fit_warnings(
    pairs: Pairs, counts: Unwrapped, predicted: np.ndarray, machine: Oscillator, scale: Scale
) -> list[str]:
    """Sentences on the pairs of a fit; `predicted` are its computed final displacements [m]."""
    warnings = count_warnings(pairs, counts)
    farthest, immobile = float(np.max(np.abs(pairs.xf - predicted))), int(np.sum(counts.half_cycles == 0))
    if np.all(counts.half_cycles < 2):
        warnings.append(
            "No pair has two half-cycles or more: an offset of the equilibrium then looks like friction. Release from "
            "farther away, or from both sides."
        )
    if immobile:
        warnings.append(f"In {immobile} pair(s) the mass did not move: they say nothing of mu.")
    duplicates = pairs.x0.size - np.unique(np.stack([pairs.x0, pairs.xf]), axis=1).shape[1]
    if duplicates:
        warnings.append(
            f"{duplicates} pair(s) occur more than once; if they are copies, the standard errors are too small."
        )
    if scale.contradicted:
        warnings.append(
            f"The residuals are {scale.factor:.3g} times the stated noise, so the standard errors are enlarged by as "
            "much. Give the scatter of mu from run to run (mu_scatter), or choose another law."
        )
    if farthest > 0.5 * float(machine.dead_band):
        warnings.append(
            f"A final displacement lies {farthest:.2g} m from the computed one, half a dead band or more: a number of "
            "half-cycles is wrong, or the law does not hold."
        )
    return warnings
