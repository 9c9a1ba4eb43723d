"""Values that no friction oscillator has, each with the mistake that most often makes them: a wrong unit."""

from collections.abc import Iterator, Mapping

import numpy as np

from ..estimation.space import Parameter
from ..oscillator.restoring import Pendulum
from ..show import engineering
from .problem import Problem

# Clean metals in vacuum and soft rubber come to one or two.
_LARGEST_MU = 2.0
# Springs of laboratory rigs bend by millimetres or centimetres, and a pendulum turns over beyond a half-turn to each
# side.
_LARGEST_AMPLITUDE, _LARGEST_SWING = 0.5, 2 * np.pi


def implausible(problem: Problem, values: Mapping[str, float]) -> Iterator[str]:
    """A sentence for each value that cannot be true."""
    for parameter in problem.parameters:
        if too_large(problem, parameter, values[parameter.name]):
            yield (
                f"{parameter.name} = {values[parameter.name]:.3g} is larger than any coefficient of friction: "
                "check the units of the displacement and of the normal force."
            )
    angular = problem.windows[0].quantity == "rad" or isinstance(problem.residual.oscillator.restoring, Pendulum)
    for i, window in enumerate(problem.windows):
        where = "" if len(problem.windows) == 1 else f" of run {i}"
        amplitude = window.segmentation.amplitude
        if angular and 2 * amplitude > _LARGEST_SWING:
            yield (
                f"The swing{where} spans {2 * amplitude:.3g} rad, more than a full turn: were degrees taken for "
                "radians?"
            )
        elif not angular and amplitude > _LARGEST_AMPLITUDE:
            yield (
                f"The amplitude{where} of {engineering(amplitude, 'm')} is larger than that of any friction "
                "oscillator: check the unit of the displacement."
            )


def too_large(problem: Problem, parameter: Parameter, value: float) -> bool:
    """Whether a value is a coefficient of friction larger than there are."""
    # Under unit load, which stands for an unknown one, mu is a deceleration or a dead band of any size.
    loaded = float(problem.residual.oscillator.normal_force) != 1.0
    return parameter.kind == "mu" and loaded and value > _LARGEST_MU
