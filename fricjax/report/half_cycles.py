"""The friction of each half-cycle from the positions at its ends: the map of friction against speed of one run."""

from typing import NamedTuple

import numpy as np


class HalfCycles(NamedTuple):
    """What the reversals of a run tell of its half-cycles; arrays of shape (half-cycles,).

    Attributes:
        speed: mean velocity [m/s], with its sign.
        dead_band: mean friction force over the stiffness [m]: half the width of the band in which such a friction
            would hold the mass.
    """

    speed: np.ndarray
    dead_band: np.ndarray


def half_cycles_of(times: np.ndarray, positions: np.ndarray, damping_ratio: float) -> HalfCycles:
    """Friction of the half-cycles between reversals, less the viscous loss, on a linear spring.

    A shift of the equilibrium adds to the friction one way what it takes away the other way. So the equilibrium is the
    one about which both are equally large on average; what differs between them by tilt is a part of it.

    With the amplitudes a_n about the equilibrium, each on its side, and the amplitude ratio
    ``rho = exp(-pi zeta/sqrt(1 - zeta^2))`` of viscous damping, Coulomb friction gives
    ``a_{n+1} = rho a_n - (1 + rho) F/k``. What varies with speed or amplitude is not Coulomb's.

    Args:
        times: of the reversals [s], shape (reversals,).
        positions: displacement there from about the equilibrium [m], shape (reversals,).
        damping_ratio: zeta; NaN where the run has none, and then the map is empty.

    Examples:
        >>> import numpy as np
        >>> half_cycles_of(np.array([0.0, 1.0, 2.0]), np.array([5.0, -3.0, 1.0]), 0.0).dead_band
        array([1., 1.])
    """
    if times.size < 2 or not abs(damping_ratio) < 1:
        return HalfCycles(np.empty(0), np.empty(0))
    path = np.diff(positions)
    side = -np.sign(path)
    rho = np.exp(-np.pi * damping_ratio / np.sqrt(1 - damping_ratio**2))
    dead_band = side * (rho * positions[:-1] + positions[1:]) / (1 + rho)
    if np.unique(side).size > 1:
        dead_band -= side * (dead_band[side > 0].mean() - dead_band[side < 0].mean()) / 2
    return HalfCycles(path / np.diff(times), dead_band)
