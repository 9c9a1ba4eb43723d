"""Values that no friction oscillator has, and what their records say of themselves."""

from collections.abc import Iterator, Mapping

import numpy as np

from ..data.inspect import implausible_scale
from ..estimation.space import Parameter
from ..oscillator.restoring import Pendulum
from .problem import Problem

# Clean metals in vacuum and soft rubber come to one or two.
_LARGEST_MU = 2.0


def implausible(problem: Problem, values: Mapping[str, float]) -> Iterator[str]:
    """A sentence for each value that cannot be true, and for what was taken for granted when a record was read."""
    for window in problem.windows:
        yield from window.doubts
    for parameter in problem.parameters:
        if too_large(problem, parameter, values[parameter.name]):
            yield (
                f"{parameter.name} = {values[parameter.name]:.3g} is larger than any coefficient of friction: "
                "check the units of the displacement and of the normal force."
            )
    angular = problem.windows[0].quantity == "rad" or isinstance(problem.residual.oscillator.restoring, Pendulum)
    for i, window in enumerate(problem.windows):
        where = "" if len(problem.windows) == 1 else f" of run {i}"
        interval = float(np.median(np.diff(np.asarray(window.trace.t))))
        yield from implausible_scale(window.segmentation, interval, angular=angular, where=where)


def too_large(problem: Problem, parameter: Parameter, value: float) -> bool:
    """Whether a value is a coefficient of friction larger than there are."""
    # Under unit load, which stands for an unknown one, mu is a deceleration or a dead band of any size.
    loaded = float(problem.residual.oscillator.normal_force) != 1.0
    return parameter.kind == "mu" and loaded and value > _LARGEST_MU
