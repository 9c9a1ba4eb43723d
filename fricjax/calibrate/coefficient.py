"""From the dead band to the coefficient of friction, in the two ways that a calibration allows.

A trace tells the dead band ``x_d = mu N/k`` and the natural angular frequency ``w``. With the stiffness known the
coefficient is ``mu = k x_d/N``. With the load a dead weight ``N = m_w g`` and ``k = m w^2`` it is
``mu = (w^2 x_d/g)(m/m_w)``, where only a ratio of masses is left: masses are known far better than stiffnesses.
"""

import math
from typing import Any

from ..data.errors import UsageError
from .measured import Measured
from .propagate import measured, positive, propagated

STEEL = 7900.0  # kg/m^3


def mu_by_stiffness(dead_band: Any, stiffness: Any, normal_force: Any) -> Measured:
    """Coefficient of friction ``mu = k x_d/N`` [1].

    Each argument is a float, a `Measured`, or an estimate of a fit such as ``fit.kinematics["dead_band"]``.

    Args:
        dead_band: half-width x_d of the dead band [m].
        stiffness: stiffness in contact k [N/m].
        normal_force: load on the contact N [N].

    Returns:
        The coefficient with its standard uncertainty to first order, inputs taken as independent.

    Raises:
        UsageError: an input that is no number, or a stiffness or load that is not positive.
    """
    return propagated(
        lambda x_d, k, load: k * x_d / load,
        measured("dead_band", dead_band),
        positive("stiffness", "N/m", stiffness),
        positive("normal_force", "N", normal_force),
    )


def mu_by_mass_ratio(
    dead_band: Any,
    frequency: Any,
    mass: Any,
    load_mass: Any,
    gravity: Any,
    *,
    air_density: Any = 0.0,
    load_density: Any = STEEL,
) -> Measured:
    """Coefficient of friction ``mu = (w^2 x_d/g)(m/m_w)/(1 - rho_a/rho_w)`` [1] under a dead weight.

    The buoyancy of the air carries a part ``rho_a/rho_w`` of the weight, 1.5e-4 for steel in a room.

    Args:
        dead_band: half-width x_d of the dead band [m]; like all others a float, a `Measured`, or an estimate of a fit.
        frequency: undamped natural frequency in contact [Hz], ``w = 2 pi f``.
        mass: moving mass m [kg].
        load_mass: mass m_w of the dead weight [kg].
        gravity: local acceleration of free fall g [m/s^2].
        air_density: density of the air rho_a [kg/m^3], about 1.2; zero for a load_mass that is already corrected.
        load_density: density of the dead weight rho_w [kg/m^3].

    Returns:
        The coefficient with its standard uncertainty to first order, inputs taken as independent.

    Raises:
        UsageError: an input that is no number, one that must be positive and is not, or air heavier than the weight.
    """
    air = measured("air_density", air_density)
    weight = positive("load_density", "kg/m^3", load_density)
    if not 0 <= air.value < weight.value:
        raise UsageError(
            f"air_density must lie between zero and the load_density of {weight.value:g} kg/m^3, got {air.value:g}."
        )
    return propagated(
        lambda x_d, f, m, m_w, g, rho_a, rho_w: (2 * math.pi * f) ** 2 * x_d * m / (m_w * g * (1 - rho_a / rho_w)),
        measured("dead_band", dead_band),
        positive("frequency", "Hz", frequency),
        positive("mass", "kg", mass),
        positive("load_mass", "kg", load_mass),
        positive("gravity", "m/s^2", gravity),
        air,
        weight,
    )
