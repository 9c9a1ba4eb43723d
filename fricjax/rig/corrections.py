"""What a real rig does that the oscillator's equation leaves out, in closed form: size and correction of each effect.

Lengths in m, forces in N, angles in rad, times in s. Each function takes the numbers of one effect and says what it
does to the coefficient, the equilibrium, the stiffness or the start of the motion.

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
        uphill: apparent coefficient moving up; `downhill`: moving down.
        effective: coefficient that a decay shows, which has both: their mean.
        shift: displacement of the equilibrium [m].
    """

    uphill: float
    downhill: float
    effective: float
    shift: float


def tilt(mu: float, angle: float, normal_force: float, stiffness: float) -> Tilt:
    """Asymmetric friction of a tilted counterface: ``F = N (mu +- tan)/(1 -+ mu tan)``.

    A free decay is a reversal measurement: the tilt moves the equilibrium and changes mu only in second order.

    Raises:
        UsageError: an angle at which the mass would slide or jam by itself.
    """
    slope = float(np.tan(angle))
    if abs(mu * slope) >= 1 or abs(angle) >= np.pi / 2:
        raise UsageError(f"A tilt of {angle:g} rad is no small misalignment for mu = {mu:g}; check its unit.")
    up, down = (mu + slope) / (1 - mu * slope), (mu - slope) / (1 + mu * slope)
    return Tilt(up, down, (up + down) / 2, (up - down) / 2 * normal_force / stiffness)


def arcuate_load(amplitude: ArrayLike, frequency: float, leaf_length: float) -> np.ndarray:
    """Relative excess of the mean friction force over a half-cycle where leaf springs carry the load on an arc.

    Fixed and guided leaves of length L drop the load by ``3 y^2/(5 L)``; its vertical acceleration changes the normal
    force, and over a half-cycle of amplitude A the friction force is larger by ``0.4 omega^2 A^2/(L g)``.

    Args:
        amplitude: of the half-cycle [m], any shape.
        frequency: natural frequency [Hz].
        leaf_length: length of the leaves [m].
    """
    omega = 2 * np.pi * frequency
    return 0.4 * (omega * np.asarray(amplitude, float)) ** 2 / (leaf_length * GRAVITY)


def stiffness_under_load(stiffness: float, normal_force: float, leaf_length: float, *, in_tension: bool) -> float:
    """Stiffness of leaf springs that carry the load along their length: ``k +- (6/5) N/L`` [N/m].

    So the frequency has to be measured in contact, or the stiffness without contact corrected.

    Raises:
        UsageError: a load under which the leaves buckle.
    """
    changed = stiffness + (1.0 if in_tension else -1.0) * 1.2 * normal_force / leaf_length
    if changed <= 0:
        raise UsageError(f"Under {normal_force:g} N leaves of {leaf_length:g} m and {stiffness:g} N/m buckle.")
    return changed


def weight_in_air(mass: float, *, gravity: float = GRAVITY, air_density: float = 1.2, density: float = 7900.0) -> float:
    """Force of a dead weight, less the buoyancy of the air: ``m g (1 - rho_air/rho)`` [N]."""
    return mass * gravity * (1 - air_density / density)


class Release(NamedTuple):
    """What a holding force that decays as ``exp(-t/tau)`` does to a release.

    Attributes:
        amplitude_factor: amplitude of the free swing over the displacement before the release, without friction.
        delay: by which the swing lags an instant release [s].
        onset: time from the start of the decay to the first slip [s].
    """

    amplitude_factor: float
    delay: float
    onset: float


def release(time_constant: float, frequency: float, x0: float, static_band: float = 0.0) -> Release:
    """Release by a magnet: amplitude factor ``1/sqrt(1 + (omega tau)^2)`` and delay ``atan(omega tau)/omega``.

    Args:
        time_constant: of the holding force [s].
        frequency: natural frequency [Hz].
        x0: displacement before the release [m].
        static_band: half-width of the band in which static friction holds the mass [m].

    Raises:
        UsageError: a displacement inside the static band, from which nothing moves.
    """
    if not abs(x0) > static_band >= 0:
        raise UsageError(f"From {x0:g} m nothing moves: static friction holds the mass within {static_band:g} m.")
    turn = 2 * np.pi * frequency * time_constant
    onset = -time_constant * float(np.log1p(-static_band / abs(x0)))
    return Release(float(1 / np.hypot(1.0, turn)), float(np.arctan(turn) / (2 * np.pi * frequency)), onset)


def with_compliance(
    amplitude: ArrayLike, dead_band: float, holder_stiffness: float, friction_force: float
) -> np.ndarray:
    """Turning point after a half-cycle where pin holder and contact yield before they slip [m].

    Each reversal gives back ``2 F l`` with the deflection ``l = F/k_t``: ``a' = -x_d + sqrt((a - x_d)^2 + 4 x_d l)``
    for an undamped half-cycle much longer than l.

    Args:
        amplitude: deflection at which the half-cycle starts [m], any shape.
        dead_band: x_d [m].
        holder_stiffness: tangential stiffness k_t of holder and contact in series [N/m].
        friction_force: dynamic friction force F [N].
    """
    a, deflection = np.asarray(amplitude, float), friction_force / holder_stiffness
    return -dead_band + np.sqrt((a - dead_band) ** 2 + 4 * dead_band * deflection)
