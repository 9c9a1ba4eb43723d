"""A record as the residual sees it: whole, condensed, and with what its windows need to know."""

from typing import Any

import numpy as np

from ..data.segmentation.reversals import window as extreme_window
from ..oscillator import Oscillator
from ..oscillator.restoring import Pendulum
from .condense import DEGREE, Condensation, condense
from .residual import Run, filled
from .stages import StageWeights
from .window import NEVER, Window, equilibrium

# How many times longer than the shortest the longest run of a joint fit may be for them to be filled to one length.
_UNLIKE = 4
# A motion is in phase with its record where it is nearer than half the swing there, or half of the largest swing where
# little is left of it: farther away least squares may lead to the valley of the next cycle. No stage is shorter than
# four half-periods, from which frequency, friction and damping follow.
IN_PHASE, _SMALLEST, _SHORTEST = 0.5, 0.5, 4.0
# Fewest samples, those up to which sizes are powers, and the factor between them: each size is compiled for itself, and
# only chunks that hold a sample are gone through.
_POWERS = 1 << 18
_WHOLE = (4096, _POWERS, 4)
# Velocities of the law's own scale and deflections of its bristles after which its force is that of sliding: e^-10 of
# a Tanh and e^-20 of a bristle are left, below the noise of any record.
_LAYERS, _RELAXATIONS = 10.0, 20.0
# What is not known of the instant of a reversal, as a part of a half-period and in samples.
_SHARE, _SAMPLES = 1e-3, 2.5
# Twelve standard errors of the slope of a straight line: four of that beside curvatures of either side. Where the noise
# hides a reversal, the clock of the decay still has it to a part of a half-period.
_ERRORS, _LOST = 12.0, 0.25
# Part of the noise that a polynomial may miss of a large swing, and pieces of a half-cycle that always do: from a
# milliradian below the top with a noise of a nanoradian.
_MISSED, _PIECES = 0.1, 16


def full_run(window: Window, stops: bool) -> Run:
    """The run with all samples of its record; `stops` tells whether the law can hold the mass."""
    used = np.flatnonzero(window.used)
    t = np.asarray(window.trace.t) - window.origin
    samples = np.clip(t, t[used[0]], t[used[-1]]), np.asarray(window.trace.x)
    return Run(
        *_up_to(filled(t.size, *_WHOLE), *samples, np.where(window.used, 1 / window.sigma, 0.0)),
        half_cycles=np.asarray(window.half_cycles if stops else NEVER),
        fixed={name: np.asarray(value) for name, value in window.guesses.items()},
    )


def condensed_run(window: Window, run: Run, oscillator: Oscillator) -> Run:
    """The run with few samples that say the same.

    It has as many places as the whole one, so that both share a program, but for a record of a million samples, whose
    copies would cost more than the program.
    """
    few = condensation(window, run, oscillator)
    places = max(min(run.t.size, _POWERS), filled(few.t.size, *_WHOLE))
    return _with_samples(run, places, few.t, few.of(run.x), few.weight)


def of_one_length(runs: tuple[Run, ...]) -> tuple[Run, ...]:
    """Runs of a joint fit with samples without weight added, as many as the longest has, where few are missing."""
    sizes = [run.t.size for run in runs]
    if len(set(sizes)) == 1 or max(sizes) > _UNLIKE * min(sizes):
        return runs
    return tuple(_with_samples(run, max(sizes), run.t, run.x, run.weight) for run in runs)


def _with_samples(run: Run, n: int, t: np.ndarray, x: np.ndarray, weight: np.ndarray) -> Run:
    return run._replace(**dict(zip(("t", "x", "weight"), _up_to(n, t, x, weight), strict=True)))


def _up_to(n: int, t: np.ndarray, x: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples without weight added at the end, so that records of other lengths share one compilation."""
    return longer(t, n, t[-1]), longer(x, n, x[-1]), longer(weight, n)


def longer(values: np.ndarray, n: int, end: Any = 0.0) -> np.ndarray:
    """Values with as many added behind them as make `n`."""
    filled = np.full(n, end)
    filled[: values.size] = values
    return filled


def stage_weights_of(window: Window, run: Run) -> StageWeights:
    """Weights of a run without its rest, and how far from the record its motion may be to count as in phase."""
    segmentation, t, moving = window.segmentation, np.asarray(run.t), _without_rest(window, run)
    local = np.full(t.shape, segmentation.amplitude)
    if segmentation.turning_times.size:
        swing = np.abs(segmentation.turning_points - window.guesses["offset"])
        local = np.interp(t, segmentation.turning_times - window.origin, swing)
    tolerance = IN_PHASE * run.weight * np.maximum(local, _SMALLEST * segmentation.amplitude)
    tolerance = np.where(moving > 0, tolerance, np.inf)
    span = np.ptp(t[moving > 0])
    return StageWeights(moving, tolerance, np.asarray(_SHORTEST * segmentation.half_period / span))


def full_stage(window: Window, run: Run) -> StageWeights:
    """The stage_weights of a run that is looked at as a whole."""
    return StageWeights(_without_rest(window, run), np.full(run.weight.shape, np.inf), np.zeros(()))


def _without_rest(window: Window, run: Run) -> np.ndarray:
    return np.where(run.t <= window.stopped, run.weight, 0.0)


def condensation(window: Window, run: Run, oscillator: Oscillator) -> Condensation:
    """Which few samples stand for the used ones of a run, between its reversals.

    Around the start and each reversal samples are kept as long as the law's force still changes: until the velocity
    has passed its own scale ten times, and the sliding distance the deflection of the bristles twenty times. Beyond
    that, what is not yet smooth has decayed to e^-20. Instants are known to a few samples, to a thousandth of a
    half-period, or to what the noise leaves of them.
    """
    times, deflections = _points_at_rest(window)
    margins = _known_to(window, deflections) + _settling(window, oscillator, deflections)
    cuts = _cuts(window, oscillator, times, deflections)
    order = np.argsort(np.concatenate([times, cuts]), kind="stable")
    breaks, widths = np.concatenate([times, cuts])[order], np.concatenate([margins, np.zeros(cuts.size)])[order]
    return condense(run.t, run.weight, breaks - window.origin, widths)


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


def _points_at_rest(window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Instants of the start, the reversals and the stop [s], and the deflection that drives the mass there [m].

    A record that ends in motion may end just behind a reversal that cannot be separated from a stop: the clock has it.
    """
    segmentation = window.segmentation
    swings = np.abs(segmentation.turning_points - equilibrium(segmentation))
    later = segmentation.turning_times > window.t_start
    times = np.concatenate([[window.t_start], segmentation.turning_times[later]])
    deflections = np.concatenate([[abs(window.guesses["x0"])], swings[later]])
    lasts = times[-1] - times[-2] if times.size > 1 else segmentation.half_period
    last = times[-1] + lasts if segmentation.rest is None else segmentation.rest
    # The mass comes to the stop with the deflection of the reversal before it.
    return np.append(times, last), np.append(deflections, deflections[-1])


def _known_to(window: Window, deflections: np.ndarray) -> np.ndarray:
    """How far the instant of each reversal may be off [s]: by the sampling, and by the noise about a curved extreme."""
    segmentation, t = window.segmentation, np.asarray(window.trace.t)
    interval, half = float((t[-1] - t[0]) / (t.size - 1)), segmentation.half_period
    by_sampling = max(_SAMPLES * interval, _SHARE * half)
    width = extreme_window(half, np.maximum(deflections, segmentation.noise), segmentation.noise, interval)
    slope_error = _ERRORS * segmentation.noise / width / np.sqrt(np.maximum(2 * width / interval, 1.0))
    curvature = np.maximum(deflections, segmentation.noise) * (np.pi / half) ** 2
    margins = by_sampling + np.minimum(slope_error / curvature, _LOST * half)
    if segmentation.rest is None:
        margins[-1] = _LOST * half
    return margins


def _settling(window: Window, oscillator: Oscillator, deflections: np.ndarray) -> np.ndarray:
    """Time that the law needs to settle after a reversal [s]."""
    segmentation, law = window.segmentation, oscillator.friction
    acceleration = np.maximum(deflections, 1e-3 * segmentation.amplitude) * (np.pi / segmentation.half_period) ** 2
    speed = float(law.velocity_scale())
    bristles = float(np.max(np.asarray(law.state_scale(oscillator.normal_force)))) if law.n_states else 0.0
    by_speed = _LAYERS * speed / acceleration if np.isfinite(speed) else 0.0
    return by_speed + np.sqrt(2 * _RELAXATIONS * bristles / acceleration)
