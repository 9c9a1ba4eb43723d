"""Effects of a real rig that the equation of the oscillator omits.

Each function gives the size of one effect in closed form: the change of the coefficient, the equilibrium, the stiffness
or the start of the motion. Lengths are in m, forces in N, angles in rad, times in s.

Examples:
    >>> from fricjax.rig import corrections
    >>> corrections.tilt(0.2, angle=1e-3, normal_force=9.66, stiffness=2574.0).shift  # doctest: +ELLIPSIS
    3.90...e-06
    >>> f"{corrections.weight_in_air(0.1):.5f} N"
    '0.98052 N'
    >>> corrections.release(1e-3, frequency=12.6, x0=2e-3).delay  # doctest: +ELLIPSIS
    0.00099...
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError

GRAVITY = 9.80665


class Tilt(NamedTuple):
    """Friction on a counterface tilted about the transverse axis.

    Attributes:
        uphill, downhill: apparent coefficient of the motion up and down [1].
        effective: mean of both, the coefficient that a decay shows [1].
        shift: displacement of the equilibrium [m].
    """

    uphill: float
    downhill: float
    effective: float
    shift: float


def tilt(mu: float, angle: float, normal_force: float, stiffness: float) -> Tilt:
    """Compute the asymmetric friction of a tilted counterface.

    With the tangent of the angle the force is ``F = N (mu +- tan)/(1 -+ mu tan)``. A free decay is a reversal
    measurement, so the tilt moves the equilibrium and changes mu only in second order.

    Args:
        mu: coefficient of friction [1].
        angle: angle of the tilt [rad].
        normal_force: load on the contact [N].
        stiffness: stiffness of the spring [N/m].

    Raises:
        UsageError: at this angle the mass would slide or jam without a spring force.
    """
    slope = float(np.tan(angle))
    if abs(mu * slope) >= 1 or abs(angle) >= np.pi / 2:
        raise UsageError(f"A tilt of {angle:g} rad is no small misalignment for mu = {mu:g}; check its unit.")
    up, down = (mu + slope) / (1 - mu * slope), (mu - slope) / (1 + mu * slope)
    return Tilt(up, down, (up + down) / 2, (up - down) / 2 * normal_force / stiffness)


def arcuate_load(amplitude: ArrayLike, frequency: float, leaf_length: float) -> np.ndarray:
    """Compute the relative excess of friction if leaf springs carry the load.

    Leaves of length L, fixed at one end and guided at the other, lower the load by ``3 y^2/(5 L)`` on an arc. The
    vertical acceleration changes the normal force. Over a half-cycle of amplitude A the mean friction force is larger
    by the fraction ``0.4 omega^2 A^2/(L g)``.

    Args:
        amplitude: amplitude of the half-cycle [m], any shape.
        frequency: natural frequency [Hz].
        leaf_length: length of the leaves [m].
    """
    omega = 2 * np.pi * frequency
    return 0.4 * (omega * np.asarray(amplitude, float)) ** 2 / (leaf_length * GRAVITY)


def stiffness_under_load(stiffness: float, normal_force: float, leaf_length: float, *, in_tension: bool) -> float:
    """Compute the stiffness of loaded leaf springs, ``k +- (6/5) N/L`` [N/m].

    The leaves carry the load along their length. Measure the frequency in contact, or correct the stiffness that was
    measured without contact.

    Args:
        stiffness: stiffness without load [N/m].
        normal_force: load on the leaves [N].
        leaf_length: length of the leaves [m].
        in_tension: whether the load pulls the leaves; otherwise it compresses them.

    Raises:
        UsageError: the leaves buckle under this load.
    """
    changed = stiffness + (1.0 if in_tension else -1.0) * 1.2 * normal_force / leaf_length
    if changed <= 0:
        raise UsageError(f"Under {normal_force:g} N leaves of {leaf_length:g} m and {stiffness:g} N/m buckle.")
    return changed


def weight_in_air(mass: float, *, gravity: float = GRAVITY, air_density: float = 1.2, density: float = 7900.0) -> float:
    """Compute the weight in air, ``m g (1 - rho_air/rho)`` [N].

    Args:
        mass: mass of the dead weight [kg].
        gravity: acceleration of gravity [m/s^2].
        air_density: density of the air [kg/m^3].
        density: density of the weight [kg/m^3].
    """
    return mass * gravity * (1 - air_density / density)


class Release(NamedTuple):
    """Effect of a holding force that decays as ``exp(-t/tau)`` at release.

    Attributes:
        amplitude_factor: amplitude of the free motion over the displacement before the release, without friction [1].
        delay: delay of the motion against an instantaneous release [s].
        onset: time from the start of the decay to the first slip [s].
    """

    amplitude_factor: float
    delay: float
    onset: float


def release(time_constant: float, frequency: float, x0: float, static_band: float = 0.0) -> Release:
    """Compute the effect of a gradual release by a magnet.

    The amplitude factor is ``1/sqrt(1 + (omega tau)^2)``, the delay ``atan(omega tau)/omega``.

    Args:
        time_constant: time constant of the holding force [s].
        frequency: natural frequency [Hz].
        x0: displacement before the release [m].
        static_band: half-width of the band in which static friction holds the mass [m].

    Raises:
        UsageError: the displacement is within the static band, so the mass would not move.
    """
    if not abs(x0) > static_band >= 0:
        raise UsageError(f"From {x0:g} m nothing moves: static friction holds the mass within {static_band:g} m.")
    turn = 2 * np.pi * frequency * time_constant
    onset = -time_constant * float(np.log1p(-static_band / abs(x0)))
    return Release(float(1 / np.hypot(1.0, turn)), float(np.arctan(turn) / (2 * np.pi * frequency)), onset)


def with_compliance(
    amplitude: ArrayLike, dead_band: float, holder_stiffness: float, friction_force: float
) -> np.ndarray:
    """Compute the next turning point with a compliant holder or contact [m].

    Pin holder and contact yield before they slip. Each reversal returns the work ``2 F l`` with the deflection
    ``l = F/k_t``. For an undamped half-cycle much longer than l, ``a' = -x_d + sqrt((a - x_d)^2 + 4 x_d l)``.

    Args:
        amplitude: deflection at the start of the half-cycle [m], any shape.
        dead_band: dead band x_d [m].
        holder_stiffness: tangential stiffness k_t of holder and contact in series [N/m].
        friction_force: dynamic friction force F [N].
    """
    a, deflection = np.asarray(amplitude, float), friction_force / holder_stiffness
    return -dead_band + np.sqrt((a - dead_band) ** 2 + 4 * dead_band * deflection)
