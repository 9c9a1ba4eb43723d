"""Files of a laboratory for tests of commands and pages."""

from pathlib import Path

import numpy as np
import pandas as pd

import fricjax as fj

RIG = """\
mass = "410.68(10) g"
stiffness = "2574(2) N/m"
normal_force = "1.890(5) N"
damping = 0.1756
"""
"""Rig of the runs, as a file."""


def run(mu: float = 0.05, x0: float = 2e-3, seed: int = 1, load: float = 1.89, rate: float = 5000.0) -> fj.Record:
    """Return a run of the README's machine; its fits share programs."""
    oscillator = fj.Oscillator(0.41068, 2574.0, 0.1756, load, fj.friction.Coulomb(mu))
    return fj.synthetic_run(oscillator, x0, rate=rate, duration=2.0, noise=5e-9, seed=seed)


def write_table(path: Path, **columns: object) -> None:
    """Write columns as a CSV file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(columns).to_csv(path, index=False)


def write_run(path: Path, record: fj.Record) -> None:
    """Write a record with times in s and displacements in mm."""
    write_table(path, **{"Time [s]": record.t, "Displacement [mm]": 1e3 * record.x})


def write_pendulum(folder: Path) -> None:
    """Write the records of a gyroscope and of a tracker."""
    law, spring = fj.friction.Coulomb(0.088), fj.restoring.Pendulum()
    pendulum = fj.Oscillator(1.0, 28.8, 0.016, 1.0, law, restoring=spring)
    t, random = np.arange(2000) / 100, np.random.default_rng(1)
    motion = fj.simulate(pendulum, 0.4, t)
    rate = np.asarray(motion.v) + 0.02 + 3e-3 * random.standard_normal(t.size)
    write_table(folder / "gyro.csv", **{"time (s)": t, "angular_velocity": rate})
    x, y = (0.42 * part + 5e-4 * random.standard_normal(t.size) for part in (np.sin(motion.x), -np.cos(motion.x)))
    np.savetxt(
        folder / "tracker.txt", np.column_stack([t, x, y]), delimiter="\t", header="t (s)\tx (m)\ty (m)", comments=""
    )


def write_files(folder: Path) -> None:
    """Write runs, a sheet, volts, angles, a pendulum, and a folder."""
    write_pendulum(folder)
    several = [run(x0=x0, seed=seed) for seed, x0 in enumerate((1e-3, 2e-3, 2.9e-3))]
    for number, record in enumerate(several, 1):
        write_run(folder / f"run{number}.csv", record)
    write_run(folder / "run.csv", run())
    write_run(folder / "free.csv", run(mu=0.0))
    sheet = [(f"{name} Run #{i}", x) for i, r in enumerate(several, 1) for name, x in (("t (s)", r.t), ("x (m)", r.x))]
    write_table(folder / "sheet.csv", **dict(sheet))
    write_table(folder / "scope.csv", **{"Time [s]": several[0].t, "CH1 [V]": several[0].x / 12.5e-6})
    np.savetxt(folder / "angles.txt", 5e3 * run(rate=1000.0).x)
    for load in (2, 3):
        for number in (1, 2):
            write_run(folder / f"runs/load_{load}N/run_{number}.csv", run(seed=number, load=float(load)))
