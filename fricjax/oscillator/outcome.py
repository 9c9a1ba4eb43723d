"""Outcomes of a simulation.

Importing this module imports diffrax, which takes a quarter of a second. A fit with cached programs does not need it.
"""

import diffrax
import jax


class RESULTS(diffrax.RESULTS):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcomes of a simulation with cause and remedy.

    Examples:
        >>> print(RESULTS[RESULTS.drag_unsupported])
        The exact engine has no quadratic drag. Use the hybrid engine.
    """

    too_many_half_cycles = (
        "The motion has more half-cycles than the engine was built for. Pass an engine with a larger max_half_cycles."
    )
    overdamped = (
        "The damping ratio is one or more, so there are no half-cycles. Use the smooth engine with a regularised law, "
        "or check damping, mass and stiffness."
    )
    drag_unsupported = "The exact engine has no quadratic drag. Use the hybrid engine."
    phase_reversed = (
        "A half-cycle does not reach its reversal: friction or damping outweighs the spring in it. Check the "
        "law's coefficients against stiffness times amplitude."
    )


def is_successful(result: object) -> jax.Array:
    """Return True if a result code means success.

    Examples:
        >>> bool(is_successful(RESULTS.successful)), bool(is_successful(RESULTS.overdamped))
        (True, False)
    """
    return result == RESULTS.successful  # type: ignore[return-value]
