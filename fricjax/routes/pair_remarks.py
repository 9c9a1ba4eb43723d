"""What a reader of coefficients from pairs of displacements must know."""

import numpy as np

from ..oscillator import Oscillator
from .half_cycles import Unwrapped
from .pairs import Pairs

_AMBIGUOUS, _ADEQUATE = 5.0, 3.0


def remarks(pairs: Pairs, found: Unwrapped, predicted: np.ndarray, sigma: np.ndarray, machine: Oscillator) -> list[str]:
    """Sentences on the pairs of a fit; `sigma` is the standard deviation of each final displacement [m]."""
    said = []
    residual, band = np.abs(pairs.xf - predicted), float(machine.dead_band)
    few = int(np.sum(found.half_cycles < 2))
    if few and np.all(found.half_cycles < 2):
        said.append(
            "No pair has two half-cycles or more: an offset of the equilibrium then looks like friction. Release from "
            "farther away, or from both sides."
        )
    if np.any(found.half_cycles == 0):
        said.append(f"In {int(np.sum(found.half_cycles == 0))} pair(s) the mass did not move: they tell nothing of mu.")
    unsure = _AMBIGUOUS * sigma > band
    if pairs.half_cycles is None and np.any(unsure):
        said.append(
            f"The scatter of {float(np.max(sigma)):.2g} m is not small against the dead band of {band:.2g} m, so some "
            "numbers of half-cycles are in doubt. Give them as half_cycles."
        )
    duplicates = pairs.x0.size - np.unique(np.stack([pairs.x0, pairs.xf]), axis=1).shape[1]
    if duplicates:
        said.append(
            f"{duplicates} pair(s) occur more than once; if they are copies, the standard errors are too small."
        )
    excess = float(np.sqrt(np.mean((residual / sigma) ** 2)))
    if excess > _ADEQUATE:
        said.append(
            f"The model does not describe the pairs: their residuals are {excess:.3g} times the noise, so the standard "
            "errors are too small. Give the scatter of mu from run to run (mu_scatter), or choose another law."
        )
    if np.max(residual) > 0.5 * band:
        said.append(
            f"A final displacement lies {float(np.max(residual)):.2g} m from the computed one, half a dead band or "
            "more: a number of half-cycles is wrong, or the law does not hold."
        )
    return said
