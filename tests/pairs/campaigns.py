"""Campaigns of releases, from the half-cycle map in plain Python.

The friction is Coulomb and viscous.
"""

import numpy as np

import fricjax as fj

MASS, STIFFNESS, DAMPING_RATIO, LOAD = 0.41068, 2574.0, 0.0027, 9.66
DAMPING = 2 * DAMPING_RATIO * np.sqrt(MASS * STIFFNESS)
DAMPED = float(np.exp(-np.pi * DAMPING_RATIO / np.sqrt(1 - DAMPING_RATIO**2)))
MU = 0.05
BAND = MU * LOAD / STIFFNESS


def machine(mu: float = 0.03, mu_s: float | None = None, damping: float = DAMPING) -> fj.Oscillator:
    """The prototype rig."""
    return fj.Oscillator(MASS, STIFFNESS, damping, LOAD, fj.friction.Coulomb(mu, mu_s))


def released(y0: float, band: float = BAND, static: float = BAND, rho: float = DAMPED) -> tuple[float, list[float]]:
    """Final displacement and turning points of a release, including the release."""
    side, a = np.sign(y0), abs(y0)
    points = [a]
    while a > static:
        a = rho * a - (1 + rho) * band
        points.append(a)
    return float(side * (-1) ** (len(points) - 1) * a), points


def campaign(x0: np.ndarray, offset: float = 0.0, static: float = BAND) -> tuple[np.ndarray, np.ndarray]:
    """Final displacements and numbers of half-cycles."""
    runs = [released(x - offset, static=static) for x in x0]
    return np.array([final + offset for final, _ in runs]), np.array([len(points) - 1 for _, points in runs])
