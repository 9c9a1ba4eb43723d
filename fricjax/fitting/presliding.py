"""Stiffness and damping of a contact that yields, from the last reversal.

At the last reversal the deflection of the contact is largest. It springs back by ``l ln(2/(1 - a/x_d))``, with its
deflection in sliding ``l = F_d/sigma0`` and the spring deflection ``a`` there. It rings at the Dahl resonance
``sqrt((k + sigma0)/m)/2pi``, damped by the contact and the machine (Dahl, 1968; Yoon and Trumper, Mechatronics 24,
2014). If the record shows no rest, the stiffness follows from the energy that the contact returns at each reversal,
``2 F_d l``.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data import Segmentation
from .window import Window, equilibrium

# Analysed time after the last reversal in half-periods, 50 ms on the prototype, and approximate number of samples.
_REACH, _SAMPLES = 1.25, 1000
# Trial ratios of the Dahl resonance to the natural frequency, and trial damping ratios of a ringing.
_RESONANCES = np.geomspace(1.3, 300.0, 110)
_RATIOS = np.geomspace(0.01, 0.6, 9)
# Trial damping ratios of a contact that springs back without ringing.
_SLUGGISH = np.geomspace(0.2, 20.0, 40)
# A ringing must explain this part of the residual of a creep.
_EXPLAINS = 0.5
# Least delay of a contact that a fit resolves, in standard errors of a displacement from all samples.
_LATE = 0.3
# Least delay that double precision resolves, in dead bands.
_ROUNDING = 1e-9


class Contact(NamedTuple):
    """Stiffness [N/m] and damping [N s/m] of a contact; None if unknown."""

    stiffness: float | None
    damping: float | None


class Machine(NamedTuple):
    """Known properties of the machine.

    These are mass [kg], stiffness [N/m], damping [N s/m] and dynamic friction force [N].
    """

    mass: float
    stiffness: float
    damping: float
    friction: float


class _Settling(NamedTuple):
    """Motion after the last reversal, in the direction of the last half-cycle.

    Attributes:
        t: time since the reversal [s]; `x`: displacement [m]; `noise`: its standard deviation.
        reversal: position of the reversal relative to the equilibrium of the spring [m].
        returned: distance that it sprang back [m]; zero if it cannot be separated from noise.
    """

    t: np.ndarray
    x: np.ndarray
    noise: float
    reversal: float
    returned: float


def contact_of(windows: Sequence[Window], machine: Machine, returned: float | None) -> Contact:
    """Estimate the contact from the records.

    Args:
        windows: the records. The one with the last reversal nearest to the equilibrium is used: far from it the contact
            has begun to yield, and rings at a lower frequency.
        machine: the machine estimated from the decay.
        returned: energy that the contact returns at each reversal, from the decay [J]; None for unknown.

    If the mass rests where it turned, the estimated delay is the largest that the noise hides. If only the decay shows
    that no energy is returned, which is less certain, the estimated deflection equals the noise. Neither contact rings.
    """
    settlings = sorted(_settlings(windows), key=lambda settling: abs(settling.reversal))
    # From its ringing if it rings, else from the distance that it springs back.
    contacts = [
        _by_ringing(settling, machine) or _by_spring_back(settling, machine)
        for settling in settlings
        if settling.returned > 0
    ]
    seen = next((contact for contact in contacts if contact.stiffness is not None), None)
    if seen is not None:
        return seen
    if any(settling.returned == 0 for settling in settlings):
        return _unseen(machine, _late(machine, _noise(windows)))
    if returned == 0:
        return _unseen(machine, machine.friction / _noise(windows))
    return Contact(None if returned is None else 2 * machine.friction**2 / returned, None)


def stiffest(windows: Sequence[Window], machine: Machine) -> float:
    """Return the largest contact stiffness that the records can resolve [N/m]."""
    shown = min(float(np.median(w.sigma)) / w.gain / np.sqrt(w.used.sum() * len(windows)) for w in windows)
    return _late(machine, _LATE * shown)


def _late(machine: Machine, way: float) -> float:
    """Return the stiffness of a contact that causes a delay [N/m].

    The delay `way` is a distance [m]. After a reversal at the deflection a, a contact with the deflection l in sliding
    pushes the mass back. While it turns, during ``sqrt(2 l/a)/omega``, the mass gains ``x_d sqrt(2 l/a)`` with the dead
    band x_d. The gain is largest, ``sqrt(2 l x_d)``, if the mass hardly moves on.
    """
    band = machine.friction / machine.stiffness
    return 2 * machine.friction * band / max(way, _ROUNDING * band) ** 2


def _noise(windows: Sequence[Window]) -> float:
    """Return the noise of the samples of the least noisy record [m]."""
    return min(float(np.median(window.sigma)) / window.gain for window in windows)


def _unseen(machine: Machine, stiffness: float) -> Contact:
    return Contact(stiffness, 2 * float(np.sqrt(machine.mass * (machine.stiffness + stiffness))))


def _settlings(windows: Sequence[Window]) -> Iterator[_Settling]:
    for window in windows:
        segmentation = window.segmentation
        # Other readings do not show the place of the rest.
        direct = window.observation.kind == "displacement"
        if direct and segmentation.rest is not None and segmentation.turning_times.size >= 1:
            settling = _settling(window, segmentation)
            if settling is not None:
                yield settling


def _settling(window: Window, segmentation: Segmentation) -> _Settling | None:
    """Return the motion after the last reversal, if recorded long enough."""
    used = np.asarray(window.trace.mask)
    t, x = np.asarray(window.trace.t)[used], np.asarray(window.trace.x)[used]
    begin, h = float(segmentation.turning_times[-1]), segmentation.half_period
    last = slice(*np.searchsorted(t, [begin + 0.6 * h, begin + 1.4 * h]))
    width = max((last.stop - last.start) // 128, 1)
    if last.stop - last.start < 8 * width or t[-1] < begin + 1.5 * h:
        return None
    side = float(np.sign(x[last].mean() - segmentation.turning_points[-1]))
    smooth = np.convolve(side * x[last], np.ones(width) / width, mode="valid")
    turn = last.start + width // 2 + int(np.argmax(smooth))
    after = slice(turn, int(np.searchsorted(t, t[turn] + _REACH * h)))
    reversal, rest = float(smooth.max()), float(side * x[(after.start + 3 * after.stop) // 4 : after.stop].mean())
    noise, every = float(np.median(window.sigma)), -(-(after.stop - after.start) // _SAMPLES)
    returned = reversal - rest if reversal - rest >= thresholds.EXTREME * noise / np.sqrt(width) else 0.0
    seen = slice(after.start, after.stop, every)
    return _Settling(t[seen] - t[turn], side * x[seen], noise, reversal - side * equilibrium(segmentation), returned)


def _by_ringing(seen: _Settling, machine: Machine) -> Contact | None:
    """Fit a damped oscillation and a creep, if it rings.

    Frequencies and damping ratios are tried on a grid.
    """
    natural = np.sqrt(machine.stiffness / machine.mass)
    fastest = np.pi / 2 / float(np.median(np.diff(seen.t)))
    omega, ratio = np.meshgrid(natural * _RESONANCES[_RESONANCES * natural < fastest], _RATIOS, indexing="ij")
    creep = np.exp(-np.multiply.outer(seen.t / seen.t[-1], [0.0, 1.0, 4.0, 16.0]))
    basis = np.linalg.qr(creep)[0]
    x = seen.x - basis @ (basis.T @ seen.x)
    best, fitted = 0.0, None
    for w, z in zip(omega.ravel(), ratio.ravel(), strict=True):
        swing = np.exp((-z + 1j) * w * seen.t)
        columns = np.stack([swing.real, swing.imag], axis=1)
        columns -= basis @ (basis.T @ columns)
        explained = float(np.sum((np.linalg.qr(columns)[0].T @ x) ** 2))
        if explained > best:
            best, fitted = explained, (w, z)
    if fitted is None or best < max(_EXPLAINS * float(x @ x), (thresholds.EXTREME * seen.noise) ** 2):
        return None
    w, z = fitted
    if z == _RATIOS[-1]:
        return None
    return Contact(machine.mass * w**2 - machine.stiffness, max(2 * z * w * machine.mass - machine.damping, 0.0))


def _by_spring_back(seen: _Settling, machine: Machine) -> Contact:
    """Estimate stiffness from the distance of spring-back, and damping from its speed."""
    band = machine.friction / machine.stiffness
    if not seen.returned < band:
        return Contact(None, None)
    pulled = np.clip(seen.reversal / band, -0.98, 0.98)
    stiffness = machine.friction * float(np.log(2 / (1 - pulled))) / seen.returned
    omega = np.sqrt((machine.stiffness + stiffness) / machine.mass)
    ratio = _SLUGGISH[np.argmin([_misfit(seen, omega, ratio) for ratio in _SLUGGISH])]
    return Contact(stiffness, max(float(2 * ratio * omega * machine.mass - machine.damping), 0.0))


def _misfit(seen: _Settling, omega: float, ratio: float) -> float:
    """Return the sum of squared residuals of a damped step response [m^2].

    Its mean is fitted.
    """
    root = np.sqrt(complex(ratio**2 - 1))
    poles = omega * np.array([-ratio + root, -ratio - root])
    swing = ((poles[1] * np.exp(poles[0] * seen.t) - poles[0] * np.exp(poles[1] * seen.t)) / (poles[1] - poles[0])).real
    swing, x = swing - swing.mean(), seen.x - seen.x.mean()
    return float(x @ x - (swing @ x) ** 2 / (swing @ swing))
