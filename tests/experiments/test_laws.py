"""The table of all laws has a row for each law."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.laws.scipy_memoryless import constant
from experiments.laws.scipy_motion import Machine, direct, restarted
from experiments.laws.workloads import workloads
from tests.helpers import EXPORTED_LAWS
from tests.oracles import coulomb_viscous

COMMAND = Path(__file__).resolve().parents[2] / "experiments" / "laws" / "run.py"
MACHINE = Machine(0.41068, 2574.0, 0.17557, 9.66)


def test_every_law_is_in_the_table_on_both_motions():
    rows = [(work.law.split(",")[0], work.run.name) for work in workloads()]
    assert set(rows) == {(law, motion) for law in EXPORTED_LAWS for motion in ("sliding", "rolling")}


@pytest.mark.parametrize("method", ["LSODA", "DOP853", "Radau"])
def test_a_restarted_motion_under_coulomb_friction_is_the_closed_form(method: str):
    ts, band, omega = np.linspace(0, 0.3, 601), 0.05 * 9.66 / 2574.0, np.sqrt(2574.0 / 0.41068)
    zeta = float(0.17557 / (2 * 0.41068 * omega))
    expected = coulomb_viscous(ts, 2e-3, frequency=float(omega) / (2 * np.pi), zeta=zeta, dead_band=band)
    found = restarted(constant(0.05 * 9.66), MACHINE, 2e-3, ts, rtol=1e-10, method=method)
    assert expected.n_half_cycles == 5
    np.testing.assert_allclose(found, expected.x, rtol=0, atol=5e-11)


def test_without_a_jump_odeint_needs_no_restart():
    ts = np.linspace(0, 0.1, 201)
    law = constant(0.0, viscous=0.5)
    pair = [way(law, MACHINE, 2e-3, ts, rtol=1e-11) for way in (restarted, direct)]
    np.testing.assert_allclose(pair[0], pair[1], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_command_prints_a_row_for_each_law(tmp_path: Path):
    table = tmp_path / "out.json"
    command = [sys.executable, str(COMMAND), "--quick", "--only", "Jenkins", "--json", str(table)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = json.loads(table.read_text())
    assert {row["law"] for row in rows} == {"Jenkins"}
    assert all(f"{row['law']}  " in done.stdout for row in rows)
    assert max(row["error"] for row in rows) < 0.1 and max(row["scipy_error"] for row in rows) < 0.1
