"""Fig. 7: free vibration without contact and with a rolling sphere.

The sphere is of steel. Without contact only the flexure moves.
"""

from typing import Any

import closed_form
import numpy as np
from common import Number, Study, prototype

import fricjax as fj

LOAD, MU, X0 = 1.89, 0.005, 2e-3
TIMES = np.arange(16001) / 2e3
STROKES = 100


def study() -> Study:
    """Simulate both motions."""
    contact, alone = prototype(LOAD, MU), prototype(0.0, MU)
    rolling, free = (fj.simulate(machine, X0, TIMES) for machine in (contact, alone))
    end, decay = closed_form.of(contact).rest(X0), closed_form.of(alone).rho
    left = float(free.turning_points[STROKES]) / X0
    numbers = (
        Number("contact: half-cycles", "", int(rolling.n_half_cycles), end.half_cycles),
        Number("contact: final displacement", "m", float(rolling.x[-1]), end.x),
        Number("contact: time of the stop", "s", float(rolling.t_stop), end.time),
        Number(f"no contact: amplitude after {STROKES} half-cycles, in that of the start", "", left, decay**STROKES),
    )
    note = (
        f"Prototype from x0 = 2 mm, without contact and with N = {LOAD} N; the paper prints no coefficient of rolling "
        f"friction, mu = {MU} is our choice. Without contact the decay is exponential and has no end; friction adds a "
        "linear one, which ends."
    )
    columns = {"Time [s]": TIMES, "No contact [m]": free.x, "Rolling contact [m]": rolling.x}
    return Study("Figure 7: rolling contact against no contact", note, numbers, columns, _picture(free, rolling))


def _picture(free: fj.Motion, rolling: fj.Motion) -> Any:
    picture, axes = fj.show.figure()
    only = axes[0, 0]
    only.plot(TIMES, 1e3 * free.x, color="0.65", linewidth=0.8, label="no contact: flexure alone")
    only.plot(TIMES, 1e3 * rolling.x, color="black", linewidth=0.8, label=f"rolling steel sphere, N = {LOAD} N")
    stop = float(rolling.t_stop)
    only.plot([stop], [0.0], "o", color="#D55E00", markersize=5, label=f"stop at {stop:.2f} s")
    only.set_xlabel("Time [s]")
    only.set_ylabel("Displacement x [mm]")
    only.set_ylim(-2.2, 2.9)
    only.legend(loc="upper right", ncols=3, fontsize=8)
    return picture
