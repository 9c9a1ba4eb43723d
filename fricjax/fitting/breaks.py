"""Where the motion of a record is not smooth: its reversals and its stop, and how far around them."""

from typing import Any

import numpy as np

from ..data.segmentation.reversals import window as extreme_window
from ..oscillator import Oscillator
from ..oscillator.restoring import Pendulum
from .condense import DEGREE, Samples, condense
from .window import Window, equilibrium

_LAYERS = 10.0
_RELAXATIONS = 20.0
_SHARE = 1e-3
_SAMPLES = 2.5
# Twelve standard errors of the slope of a straight line: four of that beside curvatures of either side. Where the noise
# hides a reversal, the clock of the decay still has it to a part of a half-period.
_ERRORS, _LOST = 12.0, 0.25
# Part of the noise that a polynomial may miss of a large swing, and pieces of a half-cycle that always do: from a
# milliradian below the top with a noise of a nanoradian.
_MISSED, _PIECES = 0.1, 16


def condensed(window: Window, samples: Samples, oscillator: Oscillator) -> Samples:
    """The used samples of a record, condensed between its reversals; times count from the window's origin.

    Around the start and each reversal samples are kept as long as the law's force still changes: until the velocity
    has passed its own scale ten times, and the sliding distance the deflection of the bristles twenty times. Beyond
    that, what is not yet smooth has decayed to e^-20. Instants are known to a few samples, to a thousandth of a
    half-period, or to what the noise leaves of them.
    """
    times, deflections = _standstills(window)
    margins = _known_to(window, deflections) + _settling(window, oscillator, deflections)
    cuts = _cuts(window, oscillator, times, deflections)
    order = np.argsort(np.concatenate([times, cuts]), kind="stable")
    breaks, widths = np.concatenate([times, cuts])[order], np.concatenate([margins, np.zeros(cuts.size)])[order]
    return condense(samples, breaks - window.origin, widths)


def _cuts(window: Window, oscillator: Oscillator, times: np.ndarray, deflections: np.ndarray) -> np.ndarray:
    """Instants within the half-cycles of a pendulum between which a polynomial describes them [s].

    Near the top it hangs long and falls fast. In time its motion has poles at i K'/omega from the middle of half-cycles
    of half the duration K/omega, so that over the n-th part of one a polynomial of degree d misses ``(a + sqrt(1 +
    a^2))^-d`` with ``a = n K'/K`` (Bernstein's ellipse).
    """
    spring = oscillator.restoring
    if not isinstance(spring, Pendulum) or times.size < 2:
        return np.zeros(0)
    swings = np.clip(deflections[:-1], 1e-3, spring.largest)
    steep: Any = spring.steepened(swings)  # pyright: ignore[reportArgumentType]
    shape = np.exp(-np.asarray(spring.spread(steep)))
    reach = np.outer(shape, np.arange(1, _PIECES + 1))
    missed = swings[:, None] * (reach + np.sqrt(1 + reach**2)) ** -DEGREE
    enough = missed <= _MISSED * float(np.median(window.sigma))
    pieces = np.where(enough.any(axis=1), 1 + np.argmax(enough, axis=1), _PIECES)
    pairs = zip(times[:-1], times[1:], pieces, strict=True)
    return np.concatenate([begin + (end - begin) * np.arange(1, n) / n for begin, end, n in pairs])


def _standstills(window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Instants of the start, the reversals and the stop [s], and the deflection that drives the mass there [m].

    A record that ends in motion may end just behind a reversal that cannot be told from a stop: the clock has it.
    """
    found = window.segmentation
    swings = np.abs(found.turning_points - equilibrium(found))
    later = found.turning_times > window.t_start
    times = np.concatenate([[window.t_start], found.turning_times[later]])
    deflections = np.concatenate([[abs(window.guesses["x0"])], swings[later]])
    lasts = times[-1] - times[-2] if times.size > 1 else found.half_period
    last = times[-1] + lasts if found.rest is None else found.rest
    # The mass comes to the stop with the deflection of the reversal before it.
    return np.append(times, last), np.append(deflections, deflections[-1])


def _known_to(window: Window, deflections: np.ndarray) -> np.ndarray:
    """How far the instant of each reversal may be off [s]: by the sampling, and by the noise about a curved extreme."""
    found, t = window.segmentation, np.asarray(window.trace.t)
    interval, half = float((t[-1] - t[0]) / (t.size - 1)), found.half_period
    by_sampling = max(_SAMPLES * interval, _SHARE * half)
    width = extreme_window(half, np.maximum(deflections, found.noise), found.noise, interval)
    slope_error = _ERRORS * found.noise / width / np.sqrt(np.maximum(2 * width / interval, 1.0))
    curvature = np.maximum(deflections, found.noise) * (np.pi / half) ** 2
    margins = by_sampling + np.minimum(slope_error / curvature, _LOST * half)
    if found.rest is None:
        margins[-1] = _LOST * half
    return margins


def _settling(window: Window, oscillator: Oscillator, deflections: np.ndarray) -> np.ndarray:
    """Time that the law needs to settle after a standstill [s]."""
    found, law = window.segmentation, oscillator.friction
    acceleration = np.maximum(deflections, 1e-3 * found.amplitude) * (np.pi / found.half_period) ** 2
    speed = float(law.velocity_scale())
    bristles = float(np.max(np.asarray(law.state_scale(oscillator.normal_force)))) if law.n_states else 0.0
    by_speed = _LAYERS * speed / acceleration if np.isfinite(speed) else 0.0
    return by_speed + np.sqrt(2 * _RELAXATIONS * bristles / acceleration)
