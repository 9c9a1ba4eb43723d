"""What a reader of coefficients from pairs of displacements must know."""

import numpy as np

from ..oscillator import Oscillator
from ..show import engineering
from .half_cycles import Unwrapped, amplitude_after, decay_ratio
from .pairs import Pairs
from .scatter import Scale

# Odds at which numbers of half-cycles are told to be open, and at which a fit that stands on them is not valid.
_OPEN, _INVALID = 1e-3, 0.05


def status_of_counts(found: Unwrapped) -> str | None:
    """What is wrong with a fit whose numbers of half-cycles are open; None where they are not."""
    if found.odds <= _INVALID:
        return None
    return "open: the pairs agree with several dead bands. Give the numbers of half-cycles, or add pairs."


def open_counts(pairs: Pairs, found: Unwrapped, sigma: np.ndarray, rho: float) -> list[str]:
    """Sentences on numbers of half-cycles that the pairs leave open.

    Args:
        pairs: the pairs.
        found: their numbers of half-cycles, and the dead band and offset of the fit.
        sigma: standard deviation of each final displacement [m], shape (pairs,).
        rho: ratio of successive amplitudes under damping alone.
    """
    if pairs.half_cycles is not None:
        return []
    said = []
    if found.odds > _OPEN:
        said.append(
            f"The {pairs.x0.size} pairs may belong to another dead band than {engineering(found.dead_band, 'm')}, at "
            f"odds of about {min(found.odds, 1.0):.1g} to 1. Give their numbers of half-cycles as half_cycles, or add "
            "pairs."
        )
    start, n = pairs.x0 - found.offset, found.half_cycles
    steps = np.array([[0], [-1], [1]])
    ends = (-1.0) ** (n + steps) * np.sign(start) * amplitude_after(n + steps, np.abs(start), found.dead_band, rho)
    off = np.where(n + steps < 0, np.inf, (ends - (pairs.xf - found.offset)) / sigma) ** 2
    doubtful = np.min(off[1:], axis=0) - off[0] < -2 * np.log(_OPEN)
    if np.any(doubtful):
        said.append(
            f"{int(np.sum(doubtful))} pair(s) end so near to the edge of the dead band that one half-cycle more or "
            "less leads there as well, so some numbers of half-cycles are in doubt. Give them as half_cycles."
        )
    return said


def remarks(
    pairs: Pairs, found: Unwrapped, predicted: np.ndarray, sigma: np.ndarray, machine: Oscillator, scale: Scale
) -> list[str]:
    """Sentences on the pairs of a fit; `sigma` is the standard deviation of each final displacement [m]."""
    said = open_counts(pairs, found, sigma, decay_ratio(machine))
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
