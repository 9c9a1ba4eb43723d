"""Scales that no friction oscillator has, each with the mistake that most often makes them: a wrong unit."""

import math
from collections.abc import Iterator

from ..show import engineering
from .segmentation import Segmentation

# Springs of laboratory rigs bend by millimetres or centimetres, and a pendulum turns over beyond a half-turn to each
# side.
_LARGEST_AMPLITUDE, _LARGEST_SWING = 0.5, 2 * math.pi
# The electronics of fast interferometers count fringes up to some 5 m/s.
_LARGEST_SPEED = 5.0
_GRAVITY = 9.80665  # m/s^2
# Shot noise of a milliwatt of red light, lambda/(4 pi) sqrt(2 h nu/P) = 1.3e-15 m/sqrt(Hz).
_LEAST_DENSITY = 1e-15
# Noise relative to the amplitude below which a record is a computed one, without noise but its rounding.
_COMPUTED = 1e-10


def implausible_scale(found: Segmentation, interval: float, *, angular: bool, where: str = "") -> Iterator[str]:
    """A sentence for each scale of a record that cannot be true.

    Args:
        found: the anatomy of the record.
        interval: time between samples [s].
        angular: whether the displacement is an angle.
        where: which record, for the sentence: " of run 2".
    """
    amplitude, omega = found.amplitude, math.pi / found.half_period
    if angular:
        if 2 * amplitude > _LARGEST_SWING:
            yield (
                f"The swing{where} spans {2 * amplitude:.3g} rad, more than a full turn: were degrees taken for "
                "radians?"
            )
        return
    if amplitude > _LARGEST_AMPLITUDE:
        yield (
            f"The amplitude{where} of {engineering(amplitude, 'm')} is larger than that of any friction "
            "oscillator: check the unit of the displacement."
        )
    elif amplitude * omega > _LARGEST_SPEED:
        yield (
            f"The motion{where} would reach {amplitude * omega:.3g} m/s and "
            f"{amplitude * omega**2 / _GRAVITY:.3g} times gravity, faster than an interferometer follows: check the "
            "units of displacement and time."
        )
    density = found.white_noise * math.sqrt(2.0 * interval)
    if _COMPUTED * amplitude < found.white_noise and density < _LEAST_DENSITY:
        yield (
            f"The noise{where} of {density:.1e} m/sqrt(Hz) over its bandwidth is less than that of a milliwatt of "
            "light: check the unit of the displacement."
        )
