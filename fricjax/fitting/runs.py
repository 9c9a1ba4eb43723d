"""A record as the residual sees it: whole, condensed, and with what its windows need to know."""

import dataclasses
from typing import Any

import numpy as np

from ..oscillator import Oscillator
from .breaks import condensed
from .condense import Samples
from .residual import Run
from .sizes import filled
from .stages import StageWeights
from .window import NEVER, Window

# How many times longer than the shortest the longest run of a joint fit may be for them to be filled to one length.
_UNLIKE = 4
_IN_PHASE, _SMALLEST, _SHORTEST = 0.5, 0.5, 4.0
# Fewest samples, those up to which sizes are powers, and the factor between them: each size is compiled for itself, and
# only chunks that hold a sample are gone through.
_WHOLE = (4096, 1 << 18, 4)
# Up to this size a condensed record has as many places as the whole one, so that both share a compilation.
_SHARED = 1 << 16


def whole_run(window: Window, stops: bool) -> Run:
    """The run with all samples of its record; `stops` tells whether the law can hold the mass."""
    used = np.flatnonzero(window.used)
    t = np.asarray(window.trace.t) - window.origin
    samples = Samples(
        t=np.clip(t, t[used[0]], t[used[-1]]),
        x=np.asarray(window.trace.x),
        weight=np.where(window.used, 1 / window.sigma, 0.0),
    )
    return Run(
        *_up_to(filled(samples.t.size, *_WHOLE), samples),
        half_cycles=np.asarray(window.half_cycles if stops else NEVER),
        fixed={name: np.asarray(value) for name, value in window.guesses.items()},
    )


def condensed_run(window: Window, run: Run, oscillator: Oscillator) -> Run:
    """The run with few samples that say the same."""
    few = condensed(window, Samples(run.t, run.x, run.weight), oscillator)
    return _with_samples(run, _up_to(max(min(run.t.size, _SHARED), filled(few.t.size, *_WHOLE)), few))


def of_one_length(runs: tuple[Run, ...]) -> tuple[Run, ...]:
    """Runs of a joint fit with samples without weight added, as many as the longest has, where few are missing."""
    sizes = [run.t.size for run in runs]
    if len(set(sizes)) == 1 or max(sizes) > _UNLIKE * min(sizes):
        return runs
    return tuple(_with_samples(run, _up_to(max(sizes), Samples(run.t, run.x, run.weight))) for run in runs)


def _with_samples(run: Run, samples: Samples) -> Run:
    return dataclasses.replace(run, t=samples.t, x=samples.x, weight=samples.weight)


def _up_to(n: int, samples: Samples) -> Samples:
    """Samples without weight added at the end, so that records of other lengths share one compilation."""
    t, x, weight = samples
    return Samples(_longer(t, n, t[-1]), _longer(x, n, x[-1]), _longer(weight, n))


def _longer(values: np.ndarray, n: int, end: Any = 0.0) -> np.ndarray:
    filled = np.full(n, end)
    filled[: values.size] = values
    return filled


def stage_weights_of(window: Window, run: Run) -> StageWeights:
    """Weights of a run without its rest, and how far from the record its motion may be to count as in phase."""
    found, t = window.segmentation, np.asarray(run.t)
    rest = np.inf if found.rest is None else found.rest - window.origin
    moving = np.where(t <= rest, run.weight, 0.0)
    local = np.full(t.shape, found.amplitude)
    if found.turning_times.size:
        swing = np.abs(found.turning_points - window.guesses["offset"])
        local = np.interp(t, found.turning_times - window.origin, swing)
    tolerance = _IN_PHASE * run.weight * np.maximum(local, _SMALLEST * found.amplitude)
    tolerance = np.where(moving > 0, tolerance, np.inf)
    span = np.ptp(t[moving > 0])
    return StageWeights(moving, tolerance, np.asarray(_SHORTEST * found.half_period / span))


def full_stage(run: Run) -> StageWeights:
    """The stage_weights of a run that is looked at as a whole."""
    return StageWeights(np.asarray(run.weight), np.full(run.weight.shape, np.inf), np.zeros(()))
