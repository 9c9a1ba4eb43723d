"""What a reader of coefficients from pairs of displacements must know."""

import numpy as np

from ..oscillator import Oscillator
from ..show import engineering
from .displacements import Pairs
from .scatter import Scale
from .unwrapping import OPEN, Unwrapped

# Odds of another dead band at which a fit is not valid.
_INVALID = 0.05


def status_of_counts(found: Unwrapped) -> str | None:
    """What is wrong with a fit whose numbers of half-cycles are open; None where they are not."""
    if found.odds <= _INVALID:
        return None
    return "open: the pairs agree with several dead bands. Give the numbers of half-cycles, or add pairs."


def open_counts(pairs: Pairs, found: Unwrapped) -> list[str]:
    """Sentences on numbers of half-cycles that the pairs leave open."""
    said = []
    if found.odds > OPEN:
        said.append(
            f"The {pairs.x0.size} pairs may belong to another dead band than {engineering(found.dead_band, 'm')}, at "
            f"odds of about {min(found.odds, 1.0):.1g} to 1. Give their numbers of half-cycles as half_cycles, or add "
            "pairs."
        )
    if found.doubtful:
        said.append(
            f"One half-cycle more or less leads {found.doubtful} pair(s) as near to their ends, which lie at the edge "
            "of the dead band or alone tell the offset. Give their numbers of half-cycles as half_cycles."
        )
    return said


def remarks(
    pairs: Pairs, found: Unwrapped, predicted: np.ndarray, sigma: np.ndarray, machine: Oscillator, scale: Scale
) -> list[str]:
    """Sentences on the pairs of a fit; `sigma` is the standard deviation of each final displacement [m]."""
    said = open_counts(pairs, found)
    residual, band = np.abs(pairs.xf - predicted), float(machine.dead_band)
    few = int(np.sum(found.half_cycles < 2))
    if few and np.all(found.half_cycles < 2):
        said.append(
            "No pair has two half-cycles or more: an offset of the equilibrium then looks like friction. Release from "
            "farther away, or from both sides."
        )
    if np.any(found.half_cycles == 0):
        said.append(f"In {int(np.sum(found.half_cycles == 0))} pair(s) the mass did not move: they tell nothing of mu.")
    duplicates = pairs.x0.size - np.unique(np.stack([pairs.x0, pairs.xf]), axis=1).shape[1]
    if duplicates:
        said.append(
            f"{duplicates} pair(s) occur more than once; if they are copies, the standard errors are too small."
        )
    if scale.contradicted:
        said.append(
            f"The residuals are {scale.factor:.3g} times the stated noise, so the standard errors are enlarged by as "
            "much. Give the scatter of mu from run to run (mu_scatter), or choose another law."
        )
    if np.max(residual) > 0.5 * band:
        said.append(
            f"A final displacement lies {float(np.max(residual)):.2g} m from the computed one, half a dead band or "
            "more: a number of half-cycles is wrong, or the law does not hold."
        )
    return said
