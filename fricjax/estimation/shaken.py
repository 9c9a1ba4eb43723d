"""The colour of a motion that a floor shakes: kicks of a linear system, for as long as that system is linear.

The acceleration of a floor is not white: what Kalman's filter for white kicks leaves still remembers, and goes through
the filter of an autoregression of its own. Towards the end of a decay half-cycles become as short as what the kicks
have added up to, reversals come early or late by much of a half-cycle, and no linear system says what follows.
"""

import numpy as np

from .autoregression import autoregression, innovations, spread_of, start_of
from .colour import Colour, Series, white, whitened_columns
from .process import StateTransition, filtered, kicks_of


def first_rows(series: Series, n: int) -> Series:
    """The first rows of a series."""
    t, residual, slopes, unit, starts, rounding = series
    return Series(t[:n], residual[:n], slopes[:n], unit[:n], starts[starts < n], rounding[:n])


def kicked(series: Series, transition: StateTransition) -> Colour:
    """The colour of kicks of a linear system, beside independent noise.

    Kicks that are not white leave innovations that remember, and these are whitened by a process of their own.
    """
    kicks, std, spread, left, sides = kicks_of(series.residual, series.slopes, series.unit, transition)
    colour = white(series, std**2)._replace(left=left, kicks=kicks, spread=spread, transition=transition, sides=sides)
    begin, moving = np.zeros(1, int), transition.moving
    shaken = whitened_columns(left[:, None], series, colour)[:moving]
    shape, _ = autoregression(shaken[:, 0], begin)
    # One that is not stationary says nothing of its first rows, which the rest of the package counts on.
    if shape.size and start_of(shape).size:
        size = float(np.std(innovations(shaken, begin, shape)))
        more = spread_of(shape, begin, moving) + 2 * moving * np.log(size)
        colour = colour._replace(shape=shape, shape_std=size, spread=spread + more)
    return colour._replace(last=_as_far_as_linear(series, colour, transition))


def _as_far_as_linear(series: Series, colour: Colour, transition: StateTransition) -> int | None:
    """Number of rows in which the error of the linear system is below an innovation; None for all."""
    _, (variances,) = filtered(np.zeros((series.t.size, 1)), series.unit, transition, np.array([colour.kicks]))
    deviation = colour.kicks * colour.std**2 * transition.deviations()
    beyond = transition.bend * deviation * series.unit > colour.std * np.sqrt(variances) * colour.shape_std
    return int(np.argmax(beyond)) if beyond.any() else None
