"""An archive of velocities."""

import numpy as np

import fricjax as fj

OMEGA = 2 * np.pi * 5
MACHINE = fj.Oscillator(0.4, 0.4 * OMEGA**2, 0.1, 10.0, fj.friction.Coulomb(0.02))


def test_velocities_are_archived_in_their_unit(tmp_path):
    sensor = {"rate": 500.0, "duration": 1.5, "noise": 3e-4, "offset": 0.02}
    for seed in range(2):
        run = fj.synthetic_run(MACHINE, 10e-3, seed=seed, observation="velocity", **sensor)
        fj.write(run, tmp_path / f"run{seed}.csv")
    archive = fj.batch(sorted(tmp_path.glob("*.csv")), tmp_path / "store", MACHINE, ["mu", "damping", "stiffness"])
    table = archive.to_dataframe()
    np.testing.assert_array_equal(table["quantity"], "m/s")
    np.testing.assert_array_equal(table["outcome"], "described")
    # The first swing after the first reversal, as a velocity.
    np.testing.assert_allclose(table["amplitude"].to_numpy(float)[0], OMEGA * 8.87e-3, rtol=0.02)
    assert np.all(np.abs(table["mu"] - 0.02) < 4 * table["mu_std"])
