"""Uncertainty from few residuals, and warnings for fits to pairs."""

from typing import NamedTuple

import numpy as np

from ..estimation.covariance import COVERAGE
from ..oscillator import Oscillator
from ..show import engineering
from .displacements import Pairs
from .unwrapping import OPEN, Unwrapped

# Significance level of a contradiction between residuals and stated noise, and level of an interval: conventions.
_CONTRADICTED, _LEVEL = 0.05, 0.95
# Odds of another dead band above which a fit is not valid: one in twenty, as for its 95 % intervals.
_INVALID = 0.05


class Scale(NamedTuple):
    """Uncertainty scale of a fit with few residuals.

    Attributes:
        factor: factor on the standard errors for the stated noise; inf if there is neither stated noise nor a degree of
            freedom.
        half_width: half-width of a 95 % interval in these standard errors.
        contradicted: True if the stated noise is too small for the residuals.
    """

    factor: float
    half_width: float
    contradicted: bool


def scale_of(chi2: float, dof: int, known: bool) -> Scale:
    """Return the scale of the standard errors of a fit.

    If the stated noise is too small for the residuals, it is enlarged to match them (Birge's ratio, Phys. Rev. 40, 207,
    1932). The noise then comes from few residuals, as it does without stated noise, so the interval is Student's.

    Args:
        chi2: sum of squared weighted residuals.
        dof: degrees of freedom.
        known: True if the noise is stated; False if it follows from the residuals.
    """
    from scipy.stats import chi2 as squares

    if dof < 1:
        return Scale(1.0 if known else np.inf, COVERAGE, False)
    ratio = float(np.sqrt(chi2 / dof))
    contradicted = known and bool(squares.sf(chi2, dof) < _CONTRADICTED)
    half_width = COVERAGE if known and not contradicted else student(dof)
    return Scale(max(ratio, 1.0) if known else ratio, half_width, contradicted)


def student(dof: float) -> float:
    """Return the half-width of a 95 % interval in standard errors.

    The standard errors have `dof` degrees of freedom; inf for none.
    """
    from scipy.stats import t

    return float(t.ppf((1 + _LEVEL) / 2, dof)) if dof > 0 else np.inf


def status_of_counts(counts: Unwrapped) -> str | None:
    """Return a status if the numbers of half-cycles are uncertain, else None."""
    if counts.odds <= _INVALID:
        return None
    return "open: the pairs agree with several dead bands. Give the numbers of half-cycles, or add pairs."


def count_warnings(pairs: Pairs, counts: Unwrapped) -> list[str]:
    """Return warnings about uncertain numbers of half-cycles."""
    warnings = []
    if counts.odds > OPEN:
        warnings.append(
            f"The {pairs.x0.size} pairs may belong to another dead band than {engineering(counts.dead_band, 'm')}, at "
            f"odds of about {min(counts.odds, 1.0):.1g} to 1. Give their numbers of half-cycles as half_cycles, or add "
            "pairs."
        )
    if counts.doubtful:
        warnings.append(
            f"One half-cycle more or less fits {counts.doubtful} pair(s) equally well: they lie at the edge "
            "of the dead band or alone determine the offset. Give their numbers of half-cycles as half_cycles."
        )
    return warnings


def fit_warnings(
    pairs: Pairs, counts: Unwrapped, predicted: np.ndarray, machine: Oscillator, scale: Scale
) -> list[str]:
    """Return warnings about the pairs; `predicted` are computed finals [m]."""
    warnings = count_warnings(pairs, counts)
    farthest, immobile = float(np.max(np.abs(pairs.xf - predicted))), int(np.sum(counts.half_cycles == 0))
    if np.all(counts.half_cycles < 2):
        warnings.append(
            "No pair has two half-cycles or more: an offset of the equilibrium then looks like friction. Release from "
            "farther away, or from both sides."
        )
    if immobile:
        warnings.append(f"In {immobile} pair(s) the mass did not move, so they do not constrain mu.")
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
