"""Steps that land on the reversals of a bristle law.

The rate of a bristle contains ``|v|``, which has a kink where the velocity changes sign. A step across the kink costs
the motion little, for its error is of second order in the step; but the derivatives of the motion lose one order
more, and no error estimate of the motion sees that. So the estimate is raised for steps in which the velocity changes
sign: the controller then closes in on the reversal, at the price of a few short steps.
"""

from typing import Any

import diffrax
import jax
import jax.numpy as jnp

_RAISE = 1e6


class Landing(diffrax.AbstractAdaptiveSolver, diffrax.AbstractWrappedSolver):
    """A solver for states whose second component is a velocity, with its error raised where that changes sign.

    Attributes:
        solver: the solver that makes the steps.
    """

    solver: Any

    @property
    def term_structure(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.interpolation_cls

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Any:
        return self.solver.init(terms, t0, t1, y0, args)

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return self.solver.func(terms, t0, y0, args)

    def step(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any) -> Any:
        y1, error, dense, state, result = self.solver.step(terms, t0, t1, y0, args, solver_state, made_jump)
        raised = jnp.where(y0[1] * y1[1] < 0, _RAISE, 1.0)
        return y1, jax.tree.map(lambda e: e * raised, error), dense, state, result
