"""Fit measured pendulum decays.

Prints residuals, friction and damping per unit of inertia, the status, and the warnings of each fit. The runs are not
part of the repository. The environment variable FRICJAX_DATA names the folder that holds them.

    FRICJAX_DATA=... python experiments/measured/run.py
"""

import os
from pathlib import Path
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import fricjax as fj  # noqa: E402

FILES = {
    "small swing": (
        "multiarm-pendulum/SingleDataFreeSwing_1_Dt_0_0001.mat",
        {"column": "Theta1", "unit": "rad"},
    ),
    "large swing": (
        "multiarm-pendulum/SinglePendulumDataForParameterEstimation.mat",
        {"column": ["Y_id", "Y_vad"], "time": ["Time_id", "Time_vad"], "unit": "rad"},
    ),
    "rotary 1": ("rotary-pendulum/data01.txt", {"unit": "deg", "rate": 1000.0}),
    "rotary 2": ("rotary-pendulum/data02.txt", {"unit": "deg", "rate": 1000.0}),
    "rotary 3": ("rotary-pendulum/data03.txt", {"unit": "deg", "rate": 1000.0}),
}


class Model(NamedTuple):
    """Free parameters and their bounds."""

    free: tuple[str, ...]
    bounds: dict[str, tuple[float | None, float | None]] = {}  # noqa: RUF012


DRY, VISCOUS = Model(("mu", "stiffness")), Model(("damping", "stiffness"))
BOTH = Model(("mu", "damping", "stiffness"))
DRAG = Model(("mu", "damping", "stiffness", "drag"))
BOUNDED = Model(DRAG.free, {"damping": (0.0, None)})
FITS = [
    *(("small swing", name, model) for name, model in (("viscous", VISCOUS), ("dry", DRY), ("dry + viscous", BOTH))),
    ("large swing", "viscous", VISCOUS),
    ("large swing", "dry + viscous", BOTH),
    ("large swing", "with drag, c >= 0", BOUNDED),
    ("large swing", "with drag", DRAG),
    *(
        (f"rotary {i}", name, model)
        for i in (3, 1, 2)
        for name, model in (("viscous", VISCOUS), ("dry + viscous", BOTH))
    ),
]


def main() -> None:
    """Print one line per fit and the warnings below it."""
    folder = Path(os.environ.get("FRICJAX_DATA", "../shared/data"))
    print(f"{'run':<12} {'model':<18} {'rms [rad]':>10} {'f [rad/s^2]':>12} {'c [1/s]':>9} {'q':>8}  status")
    for run, name, model in FITS:
        file, options = FILES[run]
        record = fj.read(folder / file, **options)
        law = fj.friction.Coulomb(0.1 if "mu" in model.free else 0.0)
        pendulum = fj.Oscillator(1.0, 50.0, 0.0, 1.0, law, restoring=fj.restoring.Pendulum())
        found = fj.fit(record, pendulum, model.free, bounds=model.bounds, throw=False)
        machine = found.oscillator
        numbers = (found.kinematics["friction_deceleration"].value, float(machine.damping), float(machine.drag))
        f, c, q = (f"{value:.4f}" for value in numbers)
        print(f"{run:<12} {name:<18} {found.residual_rms:10.2e} {f:>12} {c:>9} {q:>8}  {found.status}")
        for sentence in found.warnings:
            print(f"{'':<12} ! {sentence}")


if __name__ == "__main__":
    main()
