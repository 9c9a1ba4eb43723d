"""Outcomes of a simulation in words: the codes of diffrax and those of the engines of this package."""

import diffrax
import jax


class RESULTS(diffrax.RESULTS):  # pyright: ignore[reportGeneralTypeIssues]
    """Every outcome of a simulation, with cause and remedy."""

    too_many_half_cycles = (
        "The motion has more half-cycles than the engine was built for. Pass an engine with a larger max_half_cycles."
    )
    overdamped = (
        "The damping ratio is one or more, so there are no half-cycles. Use the smooth engine with a regularised law, "
        "or check damping, mass and stiffness."
    )
    drag_unsupported = "The exact engine has no quadratic drag. Use the hybrid engine."
    phase_reversed = (
        "A half-cycle does not reach its reversal: friction or damping outweighs the spring on that stroke. Check the "
        "law's coefficients against stiffness times amplitude."
    )


def is_successful(result: object) -> jax.Array:
    """Whether a result code stands for success."""
    return result == RESULTS.successful  # type: ignore[return-value]
