"""Fig. 4: final against initial displacement, a triangle wave."""

from typing import Any

import closed_form
import edges
import jax
import jax.numpy as jnp
import numpy as np
from common import Number, Study, simulated_machine

import fricjax as fj

X0 = np.linspace(0.0, 3e-3, 3001)


def study() -> Study:
    """Compute the map, and read its period and amplitude from its peaks."""
    machine = simulated_machine()
    final = jax.vmap(lambda x0: fj.final_displacement(machine, x0))(jnp.asarray(X0))
    peaks = edges.find(machine, X0[::50])
    limit = closed_form.of(machine).dead_band
    numbers = (
        Number("period 4 mu N/k, largest peak distance", "m", float(np.max(peaks.x0[2:] - peaks.x0[:-2])), 4 * limit),
        Number("period 4 mu N/k, smallest peak distance", "m", float(np.min(peaks.x0[2:] - peaks.x0[:-2])), 4 * limit),
        Number("amplitude xlim, largest peak", "m", float(np.max(np.abs(peaks.below))), limit),
        Number("amplitude xlim, smallest peak", "m", float(np.min(np.abs(peaks.below))), limit),
        Number("first peak", "m", float(peaks.x0[0]), limit),
    )
    note = (
        "The machine of Fig. 2. Peaks of either sign are found by bisection; every second one has the same sign. The "
        "first segment is xf = x0: below xlim the mass does not move."
    )
    columns = {"Initial displacement [m]": X0, "Final displacement [m]": final}
    return Study("Figure 4: final against initial displacement", note, numbers, columns, _picture(final, limit))


def _picture(final: Any, limit: float) -> Any:
    picture, axes = fj.show.figure()
    only = axes[0, 0]
    only.plot(1e3 * X0, 1e3 * final, label="map")
    only.axhline(1e3 * limit, color="black", linestyle="--", linewidth=0.9, label="±xlim")
    only.axhline(-1e3 * limit, color="black", linestyle="--", linewidth=0.9)
    only.set_xlabel("Initial displacement x0 [mm]")
    only.set_ylabel("Final displacement xf [mm]")
    only.set_ylim(-1.6e3 * limit, 1.6e3 * limit)
    only.legend(loc="upper right", ncols=2, fontsize=8)
    return picture
