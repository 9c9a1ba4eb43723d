"""What the last reversal tells of a contact that yields before it slides: its stiffness and its damping.

At the last reversal the contact is bent as far as it goes. It springs back by ``l ln(2/(1 - a/x_d))``, where
``l = F_d/sigma0`` is its deflection in sliding and ``a`` the deflection of the spring there, and rings at the Dahl
resonance ``sqrt((k + sigma0)/m)/2pi`` with the contact's own damping beside that of the machine (Dahl, 1968; Yoon and
Trumper, Mechatronics 24, 2014). Where the record shows no rest, the energy that the contact returns at each reversal,
``2 F_d l``, tells the stiffness instead.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data import Segmentation
from .window import Window, equilibrium

# The settling is looked at over this many half-periods, 50 ms on the prototype, and at about this many samples.
_REACH, _SAMPLES = 1.25, 1000
# Ratios of the Dahl resonance to the natural frequency that are tried, and damping ratios of a ringing.
_RESONANCES = np.geomspace(1.3, 300.0, 110)
_RATIOS = np.geomspace(0.01, 0.6, 9)
# Damping ratios of a contact that springs back without ringing.
_SLUGGISH = np.geomspace(0.2, 20.0, 40)
# A ringing is there where it explains this part of what a creep leaves.
_EXPLAINS = 0.5
# The least delay of a contact that a fit looks for, in standard errors of a displacement from all samples.
_LATE = 0.3
# The least delay that double precision resolves, in dead bands.
_ROUNDING = 1e-9


class Contact(NamedTuple):
    """Stiffness [N/m] and damping [N s/m] of a contact before it slides, None where the record does not show it."""

    stiffness: float | None
    damping: float | None


class Machine(NamedTuple):
    """What is known of the machine: mass [kg], stiffness [N/m], damping [N s/m] and dynamic friction force [N]."""

    mass: float
    stiffness: float
    damping: float
    friction: float


class _Settling(NamedTuple):
    """The motion after a last reversal, in the direction of the last half-cycle.

    Attributes:
        t: time since the reversal [s]; `x`: displacement [m]; `noise`: its standard deviation.
        reversal: where the mass turned, from the equilibrium of the spring [m].
        returned: how far it sprang back [m]; zero where that cannot be separated from noise.
    """

    t: np.ndarray
    x: np.ndarray
    noise: float
    reversal: float
    returned: float


def contact_of(windows: Sequence[Window], machine: Machine, returned: float | None) -> Contact:
    """The contact as the records show it.

    Args:
        windows: the records; of several the one counts whose mass turned nearest to the equilibrium, for a contact that
            holds it far from there has begun to yield, and rings more slowly.
        machine: the machine as the decay shows it.
        returned: energy that the contact returns at each reversal, from the decay [J]; None for unknown.

    A contact that lets the mass rest where it turned is taken to turn as late as the noise lets it; one of which the
    decay alone tells that it returns nothing, and less surely, to bend by the noise. Neither is taken to ring.
    """
    settlings = sorted(_settlings(windows), key=lambda settling: abs(settling.reversal))
    # By its ringing where it rings, by its spring-back where it creeps home.
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
    """Stiffness beyond which a contact is as good as rigid [N/m]: no record shows how late it turns."""
    shown = min(float(np.median(w.sigma)) / np.sqrt(w.used.sum() * len(windows)) for w in windows)
    return _late(machine, _LATE * shown)


def _late(machine: Machine, way: float) -> float:
    """Stiffness of a contact that delays the mass by so long a way [m].

    A contact that bends by l before it slides pushes the mass on its way back from a reversal at the deflection a. In
    the time ``sqrt(2 l/a)/omega`` that it takes to turn, the mass gains ``x_d sqrt(2 l/a)`` with the dead band x_d:
    most, ``sqrt(2 l x_d)``, where it hardly moves on.
    """
    band = machine.friction / machine.stiffness
    return 2 * machine.friction * band / max(way, _ROUNDING * band) ** 2


def _noise(windows: Sequence[Window]) -> float:
    """Standard deviation of the samples of the least noisy record [m]."""
    return min(float(np.median(window.sigma)) for window in windows)


def _unseen(machine: Machine, stiffness: float) -> Contact:
    return Contact(stiffness, 2 * float(np.sqrt(machine.mass * (machine.stiffness + stiffness))))


def _settlings(windows: Sequence[Window]) -> Iterator[_Settling]:
    for window in windows:
        segmentation = window.segmentation
        if segmentation.rest is not None and segmentation.turning_times.size >= 1:
            settling = _settling(window, segmentation)
            if settling is not None:
                yield settling


def _settling(window: Window, segmentation: Segmentation) -> _Settling | None:
    """The motion after the last reversal, None where the record ends too soon."""
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
    """Least squares of a damped swing beside a creep, over frequencies and damping ratios; None where none rings."""
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
    """Stiffness from how far the mass springs back, damping from how fast."""
    band = machine.friction / machine.stiffness
    if not seen.returned < band:
        return Contact(None, None)
    pulled = np.clip(seen.reversal / band, -0.98, 0.98)
    stiffness = machine.friction * float(np.log(2 / (1 - pulled))) / seen.returned
    omega = np.sqrt((machine.stiffness + stiffness) / machine.mass)
    ratio = _SLUGGISH[np.argmin([_misfit(seen, omega, ratio) for ratio in _SLUGGISH])]
    return Contact(stiffness, max(float(2 * ratio * omega * machine.mass - machine.damping), 0.0))


def _misfit(seen: _Settling, omega: float, ratio: float) -> float:
    """Sum of squares that a damped swing from rest, about a place of its own, leaves of the settling [m^2]."""
    root = np.sqrt(complex(ratio**2 - 1))
    poles = omega * np.array([-ratio + root, -ratio - root])
    swing = ((poles[1] * np.exp(poles[0] * seen.t) - poles[0] * np.exp(poles[1] * seen.t)) / (poles[1] - poles[0])).real
    swing, x = swing - swing.mean(), seen.x - seen.x.mean()
    return float(x @ x - (swing @ x) ** 2 / (swing @ swing))
