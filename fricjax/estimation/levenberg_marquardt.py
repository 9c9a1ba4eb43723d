"""Levenberg-Marquardt as an optimistix solver with a statistical stopping rule.

Each pass over the model yields residual and Jacobian; only ``J'J`` and ``J'r`` are kept. Damping follows Marquardt:
each parameter is scaled by the largest diagonal element of ``J'J`` so far, so the units of residuals and parameters
do not matter. The gain ratio controls its strength (Nielsen, IMM-REP-1999-05). Bounds use an active set. Coordinates
in which the residual is linear are eliminated after every pass (variable projection).

The fit stops when the Gauss-Newton step would move the parameters by less than a small fraction of their standard
errors. The three MINPACK rules cover data without noise. They also use the Gauss-Newton step, so a step that is short
only because of damping never counts as convergence. A trial that is not finite is rejected like one that makes the
fit worse.
"""

from collections.abc import Callable
from typing import Any

import optimistix as optx
from jaxtyping import Array, Float, Int, PyTree

from .marquardt import Marquardt, State
from .passes import AbstractPasses, DensePasses
from .status import MAX_STEPS, NOT_FINITE, OUT_OF_STEPS, RUNNING, STALLED


class LevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt with bounds, variable projection and a statistical stopping rule.

    Pass ``options={"lower": ..., "upper": ..., "dof": ..., "floor": ...}``: bounds of shape (p,), the degrees of
    freedom, and the sum of squares caused by rounding alone. The optional ``"linear"`` is a mask of shape (p,) of
    coordinates in which the residual is linear while the other columns of the Jacobian do not depend on them. Only
    unbounded linear coordinates are projected.

    The `stats` of the solution hold `status` (see `status.SENTENCES`), the pass at the solution (`cost`, `gradient`,
    `normal`, `kept`), and `remaining`, the square of the remaining Gauss-Newton step in standard errors. Auxiliary
    output of the function is dropped.

    Attributes:
        passes: evaluates cost, gradient and normal matrix.
        max_steps: maximum number of passes; with 1 the solver only evaluates the start.
        tolerance: largest remaining step, in standard errors estimated from the scatter of the residuals.
        ftol: largest relative change of the sum of squares, actual and predicted; also the residual at rounding
            level, relative to that at the start.
        xtol: largest remaining step relative to the parameters, in the scaled norm.
        gtol: largest cosine between the residual and a column of the Jacobian.

    Raises:
        ValueError: linear coordinates under a loss other than squares.
    """

    passes: AbstractPasses = DensePasses()
    max_steps: int | Int[Array, ""] = MAX_STEPS
    tolerance: float | Float[Array, ""] = 1e-3
    ftol: float = 1e-15
    xtol: float = 1e-14
    gtol: float = 1e-15
    rtol: float = 0.0
    atol: float = 0.0
    norm: Callable = optx.max_norm

    def init(
        self, fn: Callable, y: Array, args: PyTree, options: dict, f_struct: PyTree, aux_struct: PyTree, tags: frozenset
    ) -> State:
        return self._method.init(y, options)

    def step(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: State, tags: frozenset
    ) -> tuple[Array, State, None]:
        return *self._method.step(fn, y, args, options, state), None

    @property
    def _method(self) -> Marquardt:
        return Marquardt(self.passes, self.max_steps, self.tolerance, self.ftol, self.xtol, self.gtol)

    def terminate(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: State, tags: frozenset
    ) -> tuple[Array, optx.RESULTS]:
        results = {
            STALLED: optx.RESULTS.nonlinear_divergence,
            NOT_FINITE: optx.RESULTS.nonfinite,
            OUT_OF_STEPS: optx.RESULTS.nonlinear_max_steps_reached,
        }
        result = optx.RESULTS.successful
        for status, outcome in results.items():
            result = optx.RESULTS.where(state.status == status, outcome, result)
        return state.status != RUNNING, result

    def postprocess(
        self,
        fn: Callable,
        y: Array,
        aux: Any,
        args: PyTree,
        options: dict,
        state: State,
        tags: frozenset,
        result: optx.RESULTS,
    ) -> tuple[Array, None, dict[str, Any]]:
        return y, None, self._method.statistics(y, options, state)
