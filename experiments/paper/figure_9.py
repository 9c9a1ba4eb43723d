"""Fig. 9: energy against time, and its loss rate against velocity.

There are four cases, with and without friction and damping. The paper prints a damping ratio of 1 %. But in its figure
the rate grows from friction only to damping only, which requires 10 %.
"""

import math
from collections.abc import Mapping
from typing import Any

import closed_form
import numpy as np
from common import LOAD, MU, STIFFNESS, Number, Study, simulated_machine

import fricjax as fj

X0, DAMPING_RATIO = 3e-3, 0.1
TIMES, TENTH = np.arange(50001) * 1e-5, slice(None, None, 10)
CASES = {
    "none": (0.0, 0.0),
    "friction": (0.0, MU),
    "damping": (DAMPING_RATIO, 0.0),
    "friction and damping": (DAMPING_RATIO, MU),
}
COLOURS = dict(zip(CASES, ("0.5", "#0072B2", "#009E73", "#D55E00"), strict=True))
BOTH = "friction and damping"


def study() -> Study:
    """Simulate all four cases."""
    machines = {name: simulated_machine(*numbers) for name, numbers in CASES.items()}
    motions = {name: fj.simulate(machine, X0, TIMES) for name, machine in machines.items()}
    energies = {name: fj.energy(machine, motions[name]) for name, machine in machines.items()}
    rate = friction_energy_rate(motions, energies)
    note = (
        "The machine of Fig. 2 from x0 = 3 mm. The damping ratio is 10 %: with the printed 1 % damping alone would "
        "lose less than friction alone below 0.69 m/s, a speed never reached. FER is the loss with both minus the "
        "loss of the motion without contact at the same speed; FER over speed is the friction force. Largest rates "
        "and integrals are those of samples 10 us apart; the data hold every tenth of them."
    )
    columns: dict[str, Any] = {"Time [s]": TIMES[TENTH]}
    for name in CASES:
        columns[f"Velocity, {name} [m/s]"] = motions[name].v[TENTH]
        columns[f"Energy, {name} [J]"] = energies[name].total[TENTH]
        columns[f"Loss rate, {name} [W]"] = energies[name].loss_power[TENTH]
    columns["FER [W]"] = rate[TENTH]
    numbers = (*_ends(motions), *_losses(motions, energies, rate))
    picture = _picture(motions, energies, rate)
    return Study("Figure 9: energy and energy rate", note, numbers, columns, picture)


def friction_energy_rate(motions: Mapping[str, fj.Motion], energies: Mapping[str, Any]) -> np.ndarray:
    """Compute the loss rate of friction from the motion with both [W].

    It is the loss rate with friction and damping minus that of the motion without friction at the same speed.
    """
    quarter = slice(0, int(np.argmax(np.abs(np.asarray(motions["damping"].v)))) + 1)
    speed = np.abs(np.asarray(motions["damping"].v))[quarter]
    viscous = np.asarray(energies["damping"].loss_power)[quarter]
    return np.asarray(energies[BOTH].loss_power) - np.interp(np.abs(np.asarray(motions[BOTH].v)), speed, viscous)


def _ends(motions: Mapping[str, fj.Motion]) -> list[Number]:
    rows = []
    for name in ("friction", BOTH):
        end = closed_form.of(simulated_machine(*CASES[name])).rest(X0)
        rows += [
            Number(f"{name}: final displacement", "m", float(motions[name].x[-1]), end.x),
            Number(f"{name}: half-cycles", "", int(motions[name].n_half_cycles), end.half_cycles),
            Number(f"{name}: time of the stop", "s", float(motions[name].t_stop), end.time),
        ]
    return rows


def _losses(motions: Mapping[str, fj.Motion], energies: Mapping[str, Any], rate: np.ndarray) -> tuple[Number, ...]:
    exact = closed_form.of(simulated_machine(*CASES[BOTH]))
    force, zeta, omega = MU * LOAD, exact.damping_ratio, exact.omega
    # The first swing of a damped oscillator is fastest at omega_d t = arccos zeta.
    fastest = X0 * omega * math.exp(-zeta * math.acos(zeta) / math.sqrt(1 - zeta**2))
    damping = 2 * zeta * omega
    start, left = STIFFNESS * X0**2 / 2, STIFFNESS * exact.rest(X0).x ** 2 / 2
    lost = float(np.trapezoid(np.asarray(energies[BOTH].loss_power), TIMES))
    speed = np.abs(np.asarray(motions[BOTH].v))
    sliding = speed > 0.01
    measured = float(np.mean(rate[sliding] / speed[sliding]))
    return (
        Number("energy at the start", "J", float(energies["none"].total[0]), start),
        Number("no loss: energy at the end", "J", float(energies["none"].total[-1]), start),
        Number(
            "friction: largest loss rate",
            "W",
            float(np.max(energies["friction"].loss_power)),
            force * omega * (X0 - force / STIFFNESS),
        ),
        Number("damping: largest loss rate", "W", float(np.max(energies["damping"].loss_power)), damping * fastest**2),
        Number(f"{BOTH}: loss rate over all time", "J", lost, start - left),
        Number("friction force as FER over speed", "N", measured, force),
    )


def _picture(motions: Mapping[str, fj.Motion], energies: Mapping[str, Any], rate: np.ndarray) -> Any:
    picture, axes = fj.show.figure(2, 1)
    top, bottom = axes[:, 0]
    picture.set_figheight(6.4)
    labels = {name: "no friction, no damping" if name == "none" else name for name in CASES}
    for name in CASES:
        top.plot(TIMES, 1e3 * energies[name].total, color=COLOURS[name], label=labels[name])
        order = np.argsort(motions[name].v)
        v, loss = (1e3 * np.asarray(values)[order] for values in (motions[name].v, energies[name].loss_power))
        bottom.plot(v, loss, color=COLOURS[name], label=labels[name])
    order = np.argsort(motions[BOTH].v)
    v = 1e3 * np.asarray(motions[BOTH].v)[order]
    bottom.plot(v, 1e3 * rate[order], color="black", linestyle=":", linewidth=2.0, label="FER")
    top.set_xlabel("Time [s]")
    top.set_ylabel("Energy [mJ]")
    bottom.set_xlabel("Velocity [mm/s]")
    bottom.set_ylabel("Rate of energy loss [mW]")
    top.legend(loc="center right", fontsize=8)
    bottom.legend(loc="upper right", fontsize=8)
    return picture
