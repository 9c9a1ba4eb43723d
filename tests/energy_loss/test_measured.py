"""Measured pendulum swings: trace fit and half-cycle energies give the same friction."""

import os
from pathlib import Path

import pytest

import fricjax as fj

FOLDER = Path(os.environ.get("FRICJAX_DATA", "../shared/data")) / "multiarm-pendulum"


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER.is_dir(), reason="FRICJAX_DATA does not name the folder of measured runs")
def test_two_swings_of_one_pendulum_fitted_together():
    swings = [
        fj.read(FOLDER / "SingleDataFreeSwing_1_Dt_0_0001.mat", column="Theta1", unit="rad"),
        fj.read(
            FOLDER / "SinglePendulumDataForParameterEstimation.mat",
            column=["Y_id", "Y_vad"],
            time=["Time_id", "Time_vad"],
            unit="rad",
        ),
    ]
    pendulum = fj.Oscillator(1.0, 40.0, 0.1, 1.0, fj.friction.Coulomb(0.1), restoring=fj.restoring.Pendulum())
    free = ("mu", "damping", "stiffness", "drag")
    trace = fj.fit(swings, pendulum, free, sigma_mode="scale", throw=False)
    assert trace.optimum_found and trace.status.startswith("does not describe: ")
    losses = {name: trace.values[name] for name in ("damping", "drag", "stiffness")}
    rig = fj.Rig(mass=1.0, normal_force=1.0, restoring="pendulum", **losses)
    energy = fj.half_cycle_friction(swings, rig)
    assert energy.mu.value == pytest.approx(trace.values["mu"], rel=0.1)
