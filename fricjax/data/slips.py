"""Slips of a fringe counter.

A slip is a step between neighbouring samples that no smooth decay can make. A counter that loses a fringe is
wrong from then on by the period of its interferometer, ``k lambda/(2 passes)``. A slip of one fringe during a decay
shifts all later samples, and with them the rest position and mu.

Candidates come from odd kernels of a few samples that reject polynomials and respond to a unit step with one. At each
sample the kernel with the smallest scatter is used, because it suits the noise of the record best. A candidate is a
slip only if a step fits the surrounding samples to within the noise, and fits better than the kinks in slope and
curvature that a release, a reversal, a stop or an impact leave.
"""

import functools
from typing import NamedTuple

import numpy as np

from .segmentation.noise import NORMAL_MAD, median, resolution

# Samples on either side of a kernel, and the highest order of the odd polynomials that it rejects. Long kernels
# suppress white noise, short kernels slow noise; high orders suit few samples per half-cycle.
_KERNELS = ((2, 1), (3, 3), (5, 3), (8, 5), (12, 3), (12, 5), (12, 9))
# Smallest response of a candidate, in standard deviations of the responses. Normal noise exceeds it with a probability
# of 4e-8, and the tests that follow are stricter.
_THRESHOLD = 5.5
# Samples that share one scale of the responses. With its neighbours a stretch covers about a half-cycle, so that the
# scale follows noise that grows with speed.
_STRETCH = 128
# Windows in which a step competes with kinks: samples on either side, and order of the polynomial.
_WINDOWS = ((5, 1), (6, 3), (8, 3), (8, 5), (10, 5), (12, 7), (16, 5), (16, 7), (16, 9))
_REACH = 16
# Smallest advantage of a step over a kink in the residual sum of squares, in noise variances. Largest residual variance
# of a step per degree of freedom, also in noise variances: a few samples give the noise only roughly.
_MARGIN, _LEFT = 10.0, 4.0
# Windows on either side that estimate the noise; each adds half a window of new samples.
_NEAR = 20
# Samples around a large response that belong to it, and the smallest distance between two slips.
_BESIDE, _APART = 2, 6
# Largest number of candidates to test; a counter that slips more often is unusable.
_MOST = 1000
# Samples that are processed at once.
_BLOCK = 1 << 17
# Ratio of noise to span of a computed record; the polynomials leave a similar part of a motion.
_ROUNDING = 1e-11
# Ratio of resolution to step below which values do not repeat by chance.
_FINE = 1e-3
# Largest deviation of a step from a whole number of fringes, in standard deviations.
_FITTING = 5.0


class Slip(NamedTuple):
    """A step of a record.

    **Fields:**

    - `index`: the first sample after the step.
    - `size`: size of the step, in the unit of the samples; a whole number of fringes if the fringe is known.
    - `std`: standard deviation of the size as estimated from the samples.
    """

    index: int
    size: float
    std: float


def slips(x: np.ndarray, fringe: float | None = None) -> list[Slip]:
    """Find the slips in evenly spaced samples without gaps.

    Args:
        x: displacements, shape `(n,)`.
        fringe: size of one fringe, in the unit of `x`; None: steps of any size count.

    Returns:
        The slips, in order. Slips less than six samples apart, or that close to an end, are not found.
    """
    if x.size < 4 * _REACH or np.ptp(x) == 0.0:
        return []
    # A computed record has at least its rounding as noise.
    least = max(resolution(x) / np.sqrt(12.0), _ROUNDING * float(np.ptp(x)))
    accepted: list[Slip] = []
    for first, size, std in _candidates(x, least):
        # Responses next to a step or a kink are large too, and a kink may hide a step nearby.
        if any(abs(first - slip.index) < _APART for slip in accepted) or not _is_step(x, first, least):
            continue
        fringes = size if fringe is None else round(size / fringe) * fringe
        if fringes and abs(size - fringes) < _FITTING * std:
            accepted.append(Slip(first, fringes, std))
    return sorted(accepted)


def _candidates(x: np.ndarray, least: float) -> list[tuple[int, float, float]]:
    """Return first sample, size and standard deviation of candidates, largest first."""
    steps: list[tuple[int, float, float]] = []
    reach = max(side for side, _ in _KERNELS)
    for begin in range(0, x.size, _BLOCK):
        start = max(begin - reach, 0)
        piece = x[start : begin + _BLOCK + reach]
        answers, scales = _answers(piece - piece.mean(), reach, least)
        sizes = np.abs(answers) / scales
        above = np.flatnonzero(sizes > _THRESHOLD)
        largest = [i for i in above if sizes[i] == sizes[max(i - _BESIDE, 0) : i + _BESIDE + 1].max()]
        steps += [
            (start + int(i), float(answers[i]), float(scales[i]))
            for i in largest
            if begin <= start + i < begin + _BLOCK
        ]
    return sorted(steps, key=lambda each: -abs(each[1]) / each[2])[:_MOST]


def _answers(x: np.ndarray, reach: int, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the step before each sample and its standard deviation.

    At each sample the kernel with the smallest scatter is used.
    """
    answers, scales = np.zeros(x.size), np.full(x.size, np.inf)
    for side, order in _KERNELS:
        kernel = _kernel(side, order)
        inside = slice(reach, x.size - reach + 1)
        responses = np.correlate(x, kernel)[reach - side : x.size - side - reach + 1]
        scale = np.maximum(_local_scale(np.abs(responses)), least * np.linalg.norm(kernel))
        better = scale < scales[inside]
        answers[inside] = np.where(better, responses, answers[inside])
        scales[inside] = np.minimum(scale, scales[inside])
    return answers, scales


@functools.cache
def _kernel(side: int, order: int) -> np.ndarray:
    """Return weights that map a unit step in the middle to one.

    They map odd polynomials up to `order` to zero; shape (2 side,).
    """
    u = (np.arange(-side, side) + 0.5) / side
    # An odd kernel maps even polynomials to zero anyway.
    basis = np.stack([0.5 * np.sign(u), *(u**power for power in range(1, order + 1, 2))], axis=1)
    return np.linalg.pinv(basis)[0]


def _local_scale(sizes: np.ndarray) -> np.ndarray:
    """Return the local standard deviation of the responses.

    It is the largest median of a stretch and its two neighbours.
    """
    length = min(_STRETCH, sizes.size)
    number = sizes.size // length
    medians = np.median(sizes[: number * length].reshape(number, length), axis=1) / NORMAL_MAD
    padded = np.pad(medians, 1, mode="edge")
    largest = np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    # The remainder at the end belongs to the last full stretch.
    return largest[np.minimum(np.arange(sizes.size) // length, number - 1)]


class _Models(NamedTuple):
    """Projections on the residual after fitting polynomials, a step, or a kink."""

    smooth: np.ndarray
    step: np.ndarray
    kinks: np.ndarray


@functools.cache
def _models(side: int, order: int) -> _Models:
    u = np.arange(-side, side) + 0.5
    powers = np.polynomial.legendre.legvander(u / side, order)
    step = 0.5 * np.sign(u)
    # A kink of slope and of curvature at every quarter of a sample.
    after = np.clip(u - np.arange(1.0 - side, side - 0.99, 0.25)[:, None], 0.0, None)[..., None]
    bases = np.concatenate([np.broadcast_to(powers, (len(after), *powers.shape)), after, after**2], axis=-1)
    residual_of = lambda basis: np.eye(u.size) - basis @ np.linalg.pinv(basis)
    with_step = np.concatenate([powers, step[:, None]], axis=1)
    return _Models(residual_of(powers), residual_of(with_step), residual_of(bases).reshape(-1, u.size))


def _is_step(x: np.ndarray, first: int, least: float) -> bool:
    """Return True if the samples show a step before `first`.

    One window that shows a step is enough: long windows may reach a kink, and noise may hide the step in short ones.
    """
    if not _REACH <= first <= x.size - _REACH:
        return False
    # Repeated values before a step mark the end of a dropout, unless all values are rounded.
    repeats = x[first - 2] == x[first - 1] or x[first] == x[first + 1]
    return not (repeats and least < _FINE * abs(x[first] - x[first - 1])) and any(
        _shows_step(x, first, least, *window) for window in _WINDOWS
    )


def _shows_step(x: np.ndarray, first: int, least: float, side: int, order: int) -> bool:
    models = _models(side, order)
    about = x[first - side : first + side]
    about = about - about.mean()
    by_step = float(np.sum((models.step @ about) ** 2))
    by_kink = float(np.min(np.sum((models.kinks @ about).reshape(-1, about.size) ** 2, axis=1)))
    if by_kink <= by_step:
        return False
    # Residuals of polynomials in nearby windows give the noise; their median ignores the slip itself.
    starts = np.clip(first - side + np.arange(-_NEAR, _NEAR + 1) * side, 0, x.size - 2 * side)
    windows = x[starts[:, None] + np.arange(2 * side)]
    residual = (windows - windows.mean(axis=1, keepdims=True)) @ models.smooth
    freedom = 2 * side - order - 1
    variance = max(median(np.sum(residual**2, axis=1)) / freedom, least**2)
    return by_step < _LEFT * freedom * variance and by_kink - by_step > _MARGIN * variance
