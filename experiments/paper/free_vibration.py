"""One release of the simulated machine: displacement and velocity against time."""

from typing import Any

import closed_form
import numpy as np
from common import LOAD, MU, STIFFNESS, Number, Study, simulated_machine

import fricjax as fj

TIMES = np.arange(5001) * 1e-4


def study(title: str, x0: float, printed: float, remark: str) -> Study:
    """Simulate the release from `x0` [m].

    `printed` is the final displacement in the paper [m].
    """
    machine = simulated_machine()
    motion = fj.simulate(machine, x0, TIMES)
    end = closed_form.of(machine).rest(x0)
    numbers = (
        Number("final displacement xf", "m", float(motion.x[-1]), end.x, printed),
        Number("half-cycles", "", int(motion.n_half_cycles), end.half_cycles),
        Number("time of the stop", "s", float(motion.t_stop), end.time),
        Number("limiting displacement xlim = mu N/k", "m", float(machine.dead_band), MU * LOAD / STIFFNESS),
    )
    note = (
        "mu = 0.1, m = 1 kg, k = 5000 N/m, N = 9.81 N, no damping. The paper gives the size of xf only; the sign is "
        f"that of the computed motion. {remark}"
    )
    columns = {"Time [s]": TIMES, "Displacement [m]": motion.x, "Velocity [m/s]": motion.v}
    return Study(title, note, numbers, columns, _picture(motion, float(machine.dead_band)))


def _picture(motion: fj.Motion, limit: float) -> Any:
    picture, axes = fj.show.figure(2, 1, share_x=True, heights=(3, 2))
    top, bottom = axes[:, 0]
    top.plot(motion.t, 1e3 * motion.x, label="displacement")
    for side in (1, -1):
        top.axhline(
            side * 1e3 * limit, color="black", linestyle="--", linewidth=0.9, label="±xlim" if side > 0 else None
        )
    end, stop = 1e3 * float(motion.x[-1]), float(motion.t_stop)
    top.plot([stop], [end], "o", color="#D55E00", markersize=5, label=f"stop at {stop:.4f} s, xf = {end:+.4f} mm")
    bottom.plot(motion.t, 1e3 * motion.v)
    top.set_ylabel("Displacement x [mm]")
    bottom.set_ylabel("Velocity dx/dt [mm/s]")
    bottom.set_xlabel("Time [s]")
    top.legend(loc="upper right", fontsize=8)
    return picture
