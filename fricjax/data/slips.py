"""Slips of a fringe counter: steps between two neighbouring samples that no smooth decay can make.

A counter that loses a fringe errs from then on by the period of its interferometer, ``k lambda/(2 passes)``. What comes
after is displaced as a whole, so that a slip of one fringe in a decay moves the position of rest and with it mu.

A step is sought as the part of a few samples on either side that an odd kernel sees once polynomials are taken out.
Every kernel answers a unit step by one, so that the one whose answers scatter least sees best in the noise that the
record has. What it points out is a slip only if a step describes the samples about it to their noise, and better than
the kinks of slope and curvature which a release, a reversal, a stop and an impact leave.
"""

import functools
from typing import NamedTuple

import numpy as np

from .segmentation.noise import NORMAL_MAD, median, resolution

# Samples on either side that a kernel takes, and the order of the odd polynomials that it is deaf to. Long ones see
# through white noise, short ones through slow noise, high orders through few samples in a half-cycle.
_KERNELS = ((2, 1), (3, 3), (5, 3), (8, 5), (12, 3), (12, 5), (12, 9))
# A step counts from so many standard deviations of the answers on; 4e-8 of those of normal noise are larger, and what
# follows is stricter.
_THRESHOLD = 5.5
# Samples that have one scale of the answers; with their neighbours about a half-cycle, so that noise which grows with
# speed is not taken for its mean.
_STRETCH = 128
# Windows in which a step is held against kinks: samples on either side, and order of the polynomial.
_WINDOWS = ((5, 1), (6, 3), (8, 3), (8, 5), (10, 5), (12, 7), (16, 5), (16, 7), (16, 9))
_REACH = 16
# How much more a kink must leave of the samples than a step, in variances of the noise; and how much a step may leave
# per degree of freedom, for the noise of a few samples is known to a factor only.
_MARGIN, _LEFT = 10.0, 4.0
# Windows to either side by which the noise is known, half of each new.
_NEAR = 20
# Samples beside a large answer that are no answers of their own, and that two slips must be apart.
_BESIDE, _APART = 2, 6
# Steps of one record that are looked at, the largest: a counter that slips more often tells nothing.
_MOST = 1000
# Samples that are looked at together.
_BLOCK = 1 << 17
# Noise relative to the span of a record below which it is a computed one; polynomials leave as much of a motion.
_ROUNDING = 1e-11
# Rounding relative to a step that is fine enough for values not to repeat by chance.
_FINE = 1e-3
# By how many standard deviations a step may differ from a whole number of fringes.
_FITTING = 5.0


class Slip(NamedTuple):
    """A step of a record.

    **Fields:**

    - `index`: the first sample after it.
    - `size`: its size, in the unit of the samples; a whole number of fringes where the fringe is known.
    - `std`: standard deviation of its size as the samples tell it.
    """

    index: int
    size: float
    std: float


def slips(x: np.ndarray, fringe: float | None = None) -> list[Slip]:
    """The slips of evenly spaced samples without gaps.

    Args:
        x: displacements, shape `(n,)`.
        fringe: size of one fringe, in the unit of `x`; None: steps of any size count.

    Returns:
        The slips in their order. Two of them less than six samples apart, or so near to an end, are not found.
    """
    if x.size < 4 * _REACH or np.ptp(x) == 0.0:
        return []
    # A computed record without noise still has that of its rounding.
    least = max(resolution(x) / np.sqrt(12.0), _ROUNDING * float(np.ptp(x)))
    accepted: list[Slip] = []
    for first, size, std in _candidates(x, least):
        # The answers beside a step are large as well, and those beside a kink, which may hide a step near by.
        if any(abs(first - slip.index) < _APART for slip in accepted) or not _is_step(x, first, least):
            continue
        fringes = size if fringe is None else round(size / fringe) * fringe
        if fringes and abs(size - fringes) < _FITTING * std:
            accepted.append(Slip(first, fringes, std))
    return sorted(accepted)


def _candidates(x: np.ndarray, least: float) -> list[tuple[int, float, float]]:
    """The first sample, the size and its standard deviation of what may be steps, the largest first."""
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
    """For each sample the step before it by the kernel that scatters least there, and its standard deviation."""
    answers, scales = np.zeros(x.size), np.full(x.size, np.inf)
    for side, order in _KERNELS:
        kernel = _kernel(side, order)
        inside = slice(reach, x.size - reach + 1)
        seen = np.correlate(x, kernel)[reach - side : x.size - side - reach + 1]
        scale = np.maximum(_local_scale(np.abs(seen)), least * np.linalg.norm(kernel))
        better = scale < scales[inside]
        answers[inside] = np.where(better, seen, answers[inside])
        scales[inside] = np.minimum(scale, scales[inside])
    return answers, scales


@functools.cache
def _kernel(side: int, order: int) -> np.ndarray:
    """Weights that answer a unit step in the middle by one and odd polynomials by zero, shape (2 side,)."""
    u = (np.arange(-side, side) + 0.5) / side
    # Even polynomials are answered by zero as they are, since a step is odd.
    basis = np.stack([0.5 * np.sign(u), *(u**power for power in range(1, order + 1, 2))], axis=1)
    return np.linalg.pinv(basis)[0]


def _local_scale(sizes: np.ndarray) -> np.ndarray:
    """Standard deviation of the answers about each sample, from the medians of stretches and their neighbours."""
    length = min(_STRETCH, sizes.size)
    number = sizes.size // length
    medians = np.median(sizes[: number * length].reshape(number, length), axis=1) / NORMAL_MAD
    padded = np.pad(medians, 1, mode="edge")
    largest = np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    # The last stretch has what does not fill one of its own.
    return largest[np.minimum(np.arange(sizes.size) // length, number - 1)]


class _Models(NamedTuple):
    """What projects samples on what is left by polynomials, by these and a step, and by these and a kink anywhere."""

    smooth: np.ndarray
    step: np.ndarray
    kinks: np.ndarray


@functools.cache
def _models(side: int, order: int) -> _Models:
    u = np.arange(-side, side) + 0.5
    powers = np.polynomial.legendre.legvander(u / side, order)
    step = 0.5 * np.sign(u)
    # A kink of slope and of curvature, a quarter of a sample apart.
    after = np.clip(u - np.arange(1.0 - side, side - 0.99, 0.25)[:, None], 0.0, None)[..., None]
    bases = np.concatenate([np.broadcast_to(powers, (len(after), *powers.shape)), after, after**2], axis=-1)
    left = lambda basis: np.eye(u.size) - basis @ np.linalg.pinv(basis)
    return _Models(left(powers), left(np.concatenate([powers, step[:, None]], axis=1)), left(bases).reshape(-1, u.size))


def _is_step(x: np.ndarray, first: int, least: float) -> bool:
    """Whether the samples about the sample `first` tell of a step before it, and of nothing else.

    One window that does is enough: longer ones may reach to a kink, in shorter ones the noise may hide the step.
    """
    if not _REACH <= first <= x.size - _REACH:
        return False
    # What follows values that repeat is the end of a dropout, unless all values are rounded.
    repeats = x[first - 2] == x[first - 1] or x[first] == x[first + 1]
    return not (repeats and least < _FINE * abs(x[first] - x[first - 1])) and any(
        _tells(x, first, least, *window) for window in _WINDOWS
    )


def _tells(x: np.ndarray, first: int, least: float, side: int, order: int) -> bool:
    models = _models(side, order)
    about = x[first - side : first + side]
    about = about - about.mean()
    by_step = float(np.sum((models.step @ about) ** 2))
    by_kink = float(np.min(np.sum((models.kinks @ about).reshape(-1, about.size) ** 2, axis=1)))
    if by_kink <= by_step:
        return False
    # What polynomials leave of windows near by is the noise; their median is deaf to the slip itself.
    starts = np.clip(first - side + np.arange(-_NEAR, _NEAR + 1) * side, 0, x.size - 2 * side)
    windows = x[starts[:, None] + np.arange(2 * side)]
    left = (windows - windows.mean(axis=1, keepdims=True)) @ models.smooth
    freedom = 2 * side - order - 1
    variance = max(median(np.sum(left**2, axis=1)) / freedom, least**2)
    return by_step < _LEFT * freedom * variance and by_kink - by_step > _MARGIN * variance
