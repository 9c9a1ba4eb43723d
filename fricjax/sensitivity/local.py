"""Derivatives of a motion with respect to coefficients and nuisances."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ..fitting.names import NUISANCES
from ..fitting.residual import Residual
from ..oscillator import Oscillator
from ..oscillator.engines import AbstractEngine
from .plan import checked_times, plan


def local(
    oscillator: Oscillator,
    x0: float,
    ts: ArrayLike,
    names: Sequence[str],
    *,
    engine: str | AbstractEngine = "auto",
) -> np.ndarray:
    """Return the derivatives of the reading after a release from rest.

    The number of half-cycles until the stop is constant, as in a fit. The static coefficient of a Coulomb law changes
    only that number, so its derivative is zero.

    Args:
        oscillator: the machine.
        x0: displacement at release [m].
        ts: times to sample at, increasing [s], shape (samples,).
        names: coefficients, by their short or dotted names, and nuisances of the run: x0, v0 (the motion has a kink at
            v0 = 0), offset, drift, t_release.
        engine: "auto", "exact", "hybrid", "smooth" or an engine.

    Returns:
        dx/d(name) in metres per SI unit of each, in the order of `names`, shape (samples, p).

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: a name is unknown, the times do not increase, or the engine cannot integrate this oscillator.

    Examples:
        In an undamped half-cycle about the dead band ``x_d = mu N/k`` the mass moves from x0 to ``2 x_d - x0``:

        >>> import numpy as np
        >>> import fricjax as fj
        >>> oscillator = fj.Oscillator(1.0, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.05))
        >>> half_period = np.pi / np.sqrt(1000.0)
        >>> fj.sensitivity.local(oscillator, 3e-3, [0.0, half_period], ["mu", "x0"]).round(6).tolist()
        [[0.0, 1.0], [0.02, -1.0]]
    """
    times = checked_times(ts)
    machine = [name for name in names if name not in NUISANCES]
    nuisance = [name for name in names if name in NUISANCES]
    planned = plan(oscillator, x0, times, machine, nuisance, engine=engine)
    columns = np.asarray(_columns(planned.residual, jnp.zeros(len(names)))) / planned.scales
    order = [*machine, *nuisance]
    return columns[:, [order.index(name) for name in names]]


@eqx.filter_jit
def _columns(residual: Residual, y: Float[Array, " p"]) -> Any:
    return jax.jacfwd(lambda at: residual.observed(at, 0, residual.runs[0]).read(residual.runs[0].t))(y)
