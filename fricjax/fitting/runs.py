"""Runs for the residual: all samples, condensed samples, and stage weights."""

import dataclasses
from typing import Any

import numpy as np

from ..data.segmentation.reversals import window as extreme_window
from ..oscillator import Oscillator
from ..oscillator.restoring import Pendulum
from .condense import DEGREE, Condensation, condense
from .residual import Run, filled
from .stages import StageWeights
from .window import NEVER, Window, equilibrium

# Largest ratio of run lengths in a joint fit for padding to one length.
_UNLIKE = 4
# A motion is in phase with its record if it is nearer than half the amplitude there, or than half of the largest
# amplitude if little is left: farther away least squares may lead to the valley of the next cycle. The shortest stage
# has four half-periods, which determine frequency, friction and damping.
IN_PHASE, _SMALLEST, _SHORTEST = 0.5, 0.5, 4.0
# Least padded size, largest size that is a power, and the factor between sizes. Each size is compiled separately;
# chunks without samples are skipped.
_POWERS = 1 << 18
_WHOLE = (4096, _POWERS, 4)
# Velocities in scales of the law, and sliding distances in bristle deflections, after which the force is that of
# sliding: e^-10 remain of a Tanh and e^-20 of a bristle, below the noise of any record.
_LAYERS, _RELAXATIONS = 10.0, 20.0
# Uncertainty of the time of a reversal, as a part of a half-period and in samples.
_SHARE, _SAMPLES = 1e-3, 2.5
# Twelve standard errors of the slope of a straight line; four if curvatures on both sides are included. If noise hides
# a reversal, the period of the decay still gives its time to a part of a half-period.
_ERRORS, _LOST = 12.0, 0.25
# Allowed error of a polynomial in units of the noise, and pieces of a half-cycle that always suffice, from a
# milliradian below the top with a noise of a nanoradian.
_MISSED, _PIECES = 0.1, 16


def full_run(window: Window, stops: bool) -> Run:
    """Return the run with all samples; `stops` if the law can hold."""
    used = np.flatnonzero(window.used)
    t = np.asarray(window.trace.t) - window.origin
    samples = np.clip(t, t[used[0]], t[used[-1]]), np.asarray(window.trace.x)
    return Run(
        *_up_to(filled(t.size, *_WHOLE), *samples, np.where(window.used, 1 / window.sigma, 0.0)),
        half_cycles=np.asarray(window.half_cycles if stops else NEVER),
        fixed={name: np.asarray(value) for name, value in window.guesses.items()},
        observation=window.observation,
    )


def condensed_run(window: Window, run: Run, oscillator: Oscillator) -> Run:
    """Return the run with few samples that have the same normal equations.

    It is padded to the size of the full run, so that both share a program. Records of a million samples are not,
    because copies would cost more than another program.
    """
    few = condensation(window, run, oscillator)
    places = max(min(run.t.size, _POWERS), filled(few.t.size, *_WHOLE))
    return _with_samples(run, places, few.t, few.of(run.x), few.weight)


def of_one_length(runs: tuple[Run, ...]) -> tuple[Run, ...]:
    """Pad the runs of a joint fit to one length, if similar."""
    sizes = [run.t.size for run in runs]
    if len(set(sizes)) == 1 or max(sizes) > _UNLIKE * min(sizes):
        return runs
    return tuple(_with_samples(run, max(sizes), run.t, run.x, run.weight) for run in runs)


def _with_samples(run: Run, n: int, t: np.ndarray, x: np.ndarray, weight: np.ndarray) -> Run:
    return run._replace(**dict(zip(("t", "x", "weight"), _up_to(n, t, x, weight), strict=True)))


def _up_to(n: int, t: np.ndarray, x: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pad samples with zero weight, so that records share a compilation."""
    return longer(t, n, t[-1]), longer(x, n, x[-1]), longer(weight, n)


def longer(values: np.ndarray, n: int, end: Any = 0.0) -> np.ndarray:
    """Pad values at the end to size `n`."""
    filled = np.full(n, end)
    filled[: values.size] = values
    return filled


def stage_weights_of(window: Window, run: Run) -> StageWeights:
    """Return weights without the rest, and tolerances for the phase."""
    segmentation, t, moving = window.segmentation, np.asarray(run.t), _without_rest(window, run)
    local = np.full(t.shape, segmentation.amplitude)
    if segmentation.turning_times.size:
        swing = np.abs(segmentation.turning_points - window.centre)
        local = np.interp(t, segmentation.turning_times - window.origin, swing)
    tolerance = IN_PHASE * run.weight * window.gain * np.maximum(local, _SMALLEST * segmentation.amplitude)
    tolerance = np.where(moving > 0, tolerance, np.inf)
    span = np.ptp(t[moving > 0])
    return StageWeights(moving, tolerance, np.asarray(_SHORTEST * segmentation.half_period / span))


def full_stage(window: Window, run: Run) -> StageWeights:
    """Return the weights of a run that is evaluated as a whole."""
    return StageWeights(_without_rest(window, run), np.full(run.weight.shape, np.inf), np.zeros(()))


def _without_rest(window: Window, run: Run) -> np.ndarray:
    return np.where(run.t <= window.stopped, run.weight, 0.0)


def condensation(window: Window, run: Run, oscillator: Oscillator) -> Condensation:
    """Select few samples that represent the used ones, between reversals.

    Around the start and each reversal samples are kept while the force of the law still changes: until the velocity is
    ten times its scale, and the sliding distance is twenty times the deflection of the bristles. Beyond that, all
    transients have decayed to e^-20. Times of reversals are known to a few samples, a thousandth of a half-period, or
    the limit set by the noise.
    """
    times, deflections = _points_at_rest(window)
    margins = _known_to(window, deflections) + _settling(window, oscillator, deflections)
    cuts = _cuts(window, oscillator, times, deflections)
    order = np.argsort(np.concatenate([times, cuts]), kind="stable")
    breaks, widths = np.concatenate([times, cuts])[order], np.concatenate([margins, np.zeros(cuts.size)])[order]
    return condense(run.t, run.weight, breaks - window.origin, widths)


def _cuts(window: Window, oscillator: Oscillator, times: np.ndarray, deflections: np.ndarray) -> np.ndarray:
    """Return times that divide half-cycles of a pendulum for polynomials [s].

    Near the top a pendulum moves slowly for long, and then fast. Its motion has poles at i K'/omega from the middle of
    half-cycles with half the duration K/omega. So over the n-th part of a half-cycle the error of a polynomial of
    degree d is ``(a + sqrt(1 + a^2))^-d`` with ``a = n K'/K`` (Bernstein's ellipse).
    """
    spring = oscillator.restoring
    if not isinstance(spring, Pendulum) or times.size < 2:
        return np.zeros(0)
    swings = np.clip(deflections[:-1], 1e-3, spring.largest)
    steep: Any = spring.steepened(swings)  # pyright: ignore[reportArgumentType]
    shape = np.exp(-np.asarray(spring.spread(steep)))
    reach = np.outer(shape, np.arange(1, _PIECES + 1))
    missed = swings[:, None] * (reach + np.sqrt(1 + reach**2)) ** -DEGREE
    enough = missed <= _MISSED * float(np.median(window.sigma)) / window.gain
    pieces = np.where(enough.any(axis=1), 1 + np.argmax(enough, axis=1), _PIECES)
    pairs = zip(times[:-1], times[1:], pieces, strict=True)
    return np.concatenate([begin + (end - begin) * np.arange(1, n) / n for begin, end, n in pairs])


def _points_at_rest(window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return times of start, reversals and stop [s], and the deflections [m].

    The deflections accelerate the mass there. A record that ends in motion may end shortly after a reversal that cannot
    be separated from a stop; its time follows from the period.
    """
    segmentation = window.segmentation
    swings = np.abs(segmentation.turning_points - equilibrium(segmentation))
    later = segmentation.turning_times > window.t_start
    times = np.concatenate([[window.t_start], segmentation.turning_times[later]])
    deflections = np.concatenate([[abs(window.guesses["x0"])], swings[later]])
    lasts = times[-1] - times[-2] if times.size > 1 else segmentation.half_period
    last = times[-1] + lasts if segmentation.rest is None else segmentation.rest
    # At the stop the deflection is that of the reversal before it.
    return np.append(times, last), np.append(deflections, deflections[-1])


def clear_of_jumps(window: Window) -> Window:
    """Drop samples that may lie on either side of a jump.

    An acceleration jumps at each reversal. A sample there that changes sides as the reversal moves would be a step of
    the residual, in which no solver finds an optimum.
    """
    if window.observation.order < 2:
        return window
    times, deflections = _points_at_rest(window)
    t, uncertain = np.asarray(window.trace.t), _known_to(window, deflections, samples=1.0)
    near = np.zeros(t.size, bool)
    for first, last in zip(*np.searchsorted(t, [times - uncertain, times + uncertain]), strict=True):
        near[first:last] = True
    return dataclasses.replace(window, used=window.used & ~near, moving=window.moving & ~near)


def _known_to(window: Window, deflections: np.ndarray, samples: float = _SAMPLES) -> np.ndarray:
    """Return the uncertainty of the time of each reversal [s].

    It follows from the sampling, in multiples of its interval, and from the noise at a curved extreme.
    """
    segmentation, t = window.segmentation, np.asarray(window.trace.t)
    interval, half = float((t[-1] - t[0]) / (t.size - 1)), segmentation.half_period
    by_sampling = max(samples * interval, _SHARE * half)
    width = extreme_window(half, np.maximum(deflections, segmentation.noise), segmentation.noise, interval)
    slope_error = _ERRORS * segmentation.noise / width / np.sqrt(np.maximum(2 * width / interval, 1.0))
    curvature = np.maximum(deflections, segmentation.noise) * (np.pi / half) ** 2
    margins = by_sampling + np.minimum(slope_error / curvature, _LOST * half)
    if segmentation.rest is None:
        margins[-1] = _LOST * half
    return margins


def _settling(window: Window, oscillator: Oscillator, deflections: np.ndarray) -> np.ndarray:
    """Return the time that the law needs to settle after reversals [s]."""
    segmentation, law = window.segmentation, oscillator.friction
    acceleration = np.maximum(deflections, 1e-3 * segmentation.amplitude) * (np.pi / segmentation.half_period) ** 2
    speed = float(law.velocity_scale())
    bristles = float(np.max(np.asarray(law.state_scale(oscillator.normal_force)))) if law.n_states else 0.0
    by_speed = _LAYERS * speed / acceleration if np.isfinite(speed) else 0.0
    return by_speed + np.sqrt(2 * _RELAXATIONS * bristles / acceleration)
