"""Where the motion of a record is not smooth: its reversals and its stop, and how far around them."""

import numpy as np

from ..oscillator import Oscillator
from .condense import Samples, condense
from .window import Window, equilibrium

_LAYERS = 10.0
_RELAXATIONS = 20.0
_SHARE = 1e-3
_SAMPLES = 2.5


def condensed(window: Window, samples: Samples, oscillator: Oscillator) -> Samples:
    """The used samples of a record, condensed between its reversals; times count from the window's origin.

    Around each reversal samples are kept as long as the law's force still changes: until the velocity has passed its
    own scale ten times, and the sliding distance the deflection of the bristles twenty times. Beyond that, what is not
    yet smooth has decayed to e^-20. Instants are known to a few samples or a thousandth of a half-period.
    """
    found = window.segmentation
    stop = () if found.rest is None else (found.rest,)
    breaks = np.concatenate([found.turning_times, stop]) - window.origin
    return condense(samples, breaks.tolist(), (_known_to(window) + _layers(window, oscillator)).tolist())


def _known_to(window: Window) -> float:
    """How far the instant of a reversal may be off [s]."""
    t = np.asarray(window.trace.t)
    interval = float((t[-1] - t[0]) / (t.size - 1))
    return max(_SAMPLES * interval, _SHARE * window.segmentation.half_period)


def _layers(window: Window, oscillator: Oscillator) -> np.ndarray:
    """Time that the law needs to settle after each reversal [s]; at the stop that of the last one."""
    found, load, law = window.segmentation, oscillator.normal_force, oscillator.friction
    distance = np.abs(found.turning_points - equilibrium(found))
    if found.rest is not None:
        distance = np.append(distance, distance[-1:] if distance.size else found.amplitude)
    acceleration = np.maximum(distance, 1e-3 * found.amplitude) * (np.pi / found.half_period) ** 2
    speed = float(law.velocity_scale())
    deflection = float(np.max(np.asarray(law.state_scale(load)), initial=0.0))
    by_speed = _LAYERS * speed / acceleration if np.isfinite(speed) else 0.0
    return by_speed + np.sqrt(2 * _RELAXATIONS * deflection / acceleration)
