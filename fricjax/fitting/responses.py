"""Responses of the motion to forces that the model omits.

They are linear responses of the oscillator along its measured decay. A force f changes the displacement since the last
reversal by ``integral f(theta) sin(phi - theta) d theta / k`` (Nayfeh and Mook, Nonlinear Oscillations, 1979, 3).
Earlier changes oscillate and decay. Amplitudes and times are those of the record.
"""

from typing import NamedTuple

import numpy as np

from ..data.observation import Observation
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..oscillator.restoring import Linear
from .derived import UNITS, Derived
from .window import Window, equilibrium, without_ringing

# Fewest half-cycles for which the effect of a force differs from that of other start values.
_FEWEST = 3
# Phases of a half-cycle at which forces are computed. Assumed scales: falling friction changes within a part of the
# largest speed, and a contact bends over a part of the largest amplitude. Other scales are detected as well.
_PHASES = np.linspace(0.0, np.pi, 33)
_SLOW, _BENT = 0.2, 0.005


class _HalfCycles(NamedTuple):
    """The half-cycles of a run.

    Attributes:
        t: times of the reversals and of the stop, which bound the half-cycles, shape (n + 1,); `swing`: amplitudes at
            these times.
        side: sign of the displacement at the start of each, shape (n,); `mean`: mean amplitude.
    """

    t: np.ndarray
    side: np.ndarray
    mean: np.ndarray
    swing: np.ndarray


class Responses(NamedTuple):
    """Responses of the motion to forces.

    Attributes:
        forces: names of each force for positive and negative sign; the latter is empty if that sign is impossible.
        effects: change of the reading by each, up to a positive factor, shape (n, forces).
        half_cycles: number of half-cycles.
    """

    forces: tuple[tuple[str, str], ...]
    effects: np.ndarray
    half_cycles: int


def responses(window: Window, derived: Derived, kinds: set[str], t: np.ndarray) -> Responses:
    """Return the responses to all known forces that the model omits.

    They are empty if there are too few half-cycles.

    Args:
        window: the fitted part of a record.
        derived: the fitted oscillator.
        kinds: kinds of the free parameters; forces that these describe are excluded.
        t: times of the run [s], shape (n,).
    """
    half_cycles = _half_cycles_of(window)
    n = half_cycles.mean.size
    forces = _forces(half_cycles, derived.machine, kinds) if n >= _FEWEST else {}
    if not forces:
        return Responses((), np.zeros((t.size, 0)), n)
    effects = _responses(half_cycles, np.stack(list(forces.values())), derived, t, window.observation)
    return Responses(tuple(forces), effects, n)


def _half_cycles_of(window: Window) -> _HalfCycles:
    segmentation = without_ringing(window.segmentation)
    later = segmentation.turning_times >= window.t_start - segmentation.half_period / 4
    times, y = segmentation.turning_times[later], (segmentation.turning_points - equilibrium(segmentation))[later]
    if segmentation.rest is None or segmentation.rest_position is None:
        end, last = times[-1:] + segmentation.half_period, y[-1:]
    else:
        end, last = [segmentation.rest], [segmentation.rest_position - equilibrium(segmentation)]
    swing = np.abs(np.concatenate([y, last]))
    return _HalfCycles(np.concatenate([times, end]) - window.origin, np.sign(y), (swing[:-1] + swing[1:]) / 2, swing)


def _forces(half_cycles: _HalfCycles, machine: Oscillator, kinds: set[str]) -> dict[tuple[str, str], np.ndarray]:
    """Return each force in each half-cycle, shape (n, phases).

    It is positive towards the side on which the half-cycle begins.
    """
    mean, largest = half_cycles.mean[:, None], half_cycles.mean.max()
    speed, x = mean * np.sin(_PHASES), mean * np.cos(_PHASES)
    forces = {("damping", ""): speed, ("drag", ""): speed**2}
    if not machine.friction.n_states and isinstance(machine.friction.set_valued_limit(), Coulomb):
        # Laws other than constant friction have forces that these may represent. A contact that bends may be weaker
        # than one that slides or, because of its damping, stronger.
        forces["falling", ""] = np.exp(-((speed / (_SLOW * largest)) ** 2))
        forces["contact", "contact"] = np.exp((x - mean) / (_BENT * largest))
    if isinstance(machine.restoring, Linear):
        forces["softening", "stiffening"] = x**3
    return {names: force for names, force in forces.items() if names[0] not in kinds}


def _responses(
    half_cycles: _HalfCycles, forces: np.ndarray, derived: Derived, t: np.ndarray, observation: Observation
) -> np.ndarray:
    """Return the responses to forces of shape (forces, half-cycles, phases).

    Friction changes sign at the reversals of the disturbed motion: there a change of velocity is reduced by the ratio
    of the accelerations (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, 7).
    """
    n, side = half_cycles.mean.size, half_cycles.side
    damping, band = (float(derived.kinematics[list(UNITS).index(name)]) for name in ("damping_ratio", "dead_band"))
    # Complex amplitude: displacement and velocity over the angular frequency, rotated back by the phase.
    each = forces * np.exp((damping + 1j) * _PHASES)
    integral = np.zeros(each.shape, complex)
    np.cumsum((each[..., 1:] + each[..., :-1]) * (_PHASES[1] / 2), axis=-1, out=integral[..., 1:])
    shrunk = np.maximum(half_cycles.swing - band, 0.0) / (half_cycles.swing + band)
    kept = np.exp(-damping * np.pi) * np.stack([np.ones(n), shrunk[1:]], axis=1)[:, :, None]
    end = -1j * side[:, None] * integral[:, :, -1].T
    forced = kept * np.stack([end.real, end.imag], axis=1)
    state = np.zeros(forced.shape)
    for i in range(n - 1):
        state[i + 1] = forced[i] - kept[i] * state[i]
    begin = state[:, 0] + 1j * state[:, 1]
    number = np.clip(np.searchsorted(half_cycles.t, t, side="right") - 1, 0, n - 1)
    part = np.clip((t - half_cycles.t[number]) / np.diff(half_cycles.t)[number], 0.0, 1.0)
    at = np.rint(part * (_PHASES.size - 1)).astype(int)
    phasor = begin[number] + 1j * side[number, None] * integral.transpose(1, 2, 0)[number, at]
    moved = phasor * np.exp(-(damping + 1j) * np.pi * part)[:, None]
    # In units of the angular frequency the acceleration is the force minus the displacement.
    driven = side[number, None] * forces.transpose(1, 2, 0)[number, at]
    seen = (moved.real, moved.imag, driven - moved.real)[observation.order]
    x = (side * half_cycles.mean)[number] * np.cos(np.pi * part)
    return seen if observation.linear else seen * observation.slope(x)[:, None]
