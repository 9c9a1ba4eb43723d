"""`fricjax map`: friction from final displacements, in a table or in records."""

import json

import numpy as np
import pytest

import fricjax as fj
from tests.pairs.campaigns import BAND, DAMPING, LOAD, MASS, MU, STIFFNESS, campaign, machine

RIG = ("--mass", str(MASS), "--stiffness", str(STIFFNESS), "--normal-force", str(LOAD), "--fix", f"damping={DAMPING}")
STARTS = np.linspace(0.25e-3, 2e-3, 24)


@pytest.fixture
def table(tmp_path):
    xf, _ = campaign(STARTS, offset=3e-6, static=1.1 * BAND)
    rows = [f"{1e3 * a:.9f}; {1e6 * b:.9f}" for a, b in zip(STARTS, xf, strict=True)]
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join(["x0 [mm]; xf [um]", *rows]))
    return path


def test_a_table_of_pairs(fricjax, table, tmp_path):
    outcome = fricjax("map", str(table), *RIG, "--json", "--plot", str(tmp_path / "map.png"))
    assert outcome.code == 0
    found = json.loads(outcome.out)
    assert found["final_displacements"]["values"]["mu"] == pytest.approx(MU, rel=1e-6)
    assert found["triangle_map"]["values"]["mu"] == pytest.approx(MU, rel=1e-6)
    low, high = found["final_displacements"]["intervals"]["mu_s"]
    assert low <= 1.1 * MU <= high
    assert (tmp_path / "map.png").stat().st_size > 10_000


@pytest.mark.slow
def test_records(fricjax, tmp_path):
    files = []
    for i, x0 in enumerate((0.9e-3, 1.3e-3, 1.9e-3)):
        record = fj.synthetic_run(machine(MU), x0, rate=10e3, duration=0.4, noise=1e-9, seed=i)
        files.append(str(tmp_path / f"run{i}.csv"))
        fj.write(record, files[-1])
    outcome = fricjax("map", *files, *RIG, "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out)["final_displacements"]["values"]["mu"] == pytest.approx(MU, rel=1e-4)


def test_without_a_rig(fricjax, table):
    outcome = fricjax("map", str(table))
    assert outcome.code == 2
    assert "A map needs its rig to find mu" in outcome.err


def test_a_row_that_is_no_pair(fricjax, table):
    table.write_text(table.read_text() + "\n1.0; here")
    outcome = fricjax("map", str(table), *RIG)
    assert outcome.code == 4
    assert "pairs.csv, row 26" in outcome.err and "does not hold 2 numbers" in outcome.err


@pytest.mark.slow
def test_a_map_that_determines_nothing_is_one_json_object_with_its_code(fricjax, table):
    """Runs of one half-cycle leave offset and dead band undetermined."""
    starts = np.array([0.25e-3, 0.3e-3, 0.4e-3, 0.5e-3])
    rows = [f"{1e3 * a:.9f}; {1e6 * b:.9f}" for a, b in zip(starts, campaign(starts)[0], strict=True)]
    table.write_text("\n".join(["x0 [mm]; xf [um]", *rows]))
    outcome = fricjax("map", str(table), *RIG, "--json")
    assert outcome.code == 3
    data = json.loads(outcome.out)
    assert (data["kind"], data["exit_code"]) == ("fit", 3)
    assert data["error"] == data["final_displacements"]["status"]
