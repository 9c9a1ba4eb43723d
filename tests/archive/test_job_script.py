"""The job script of the documentation fits each file once."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import fricjax as fj
from fricjax.data.read import example_paths
from tests.documents import ROOT, blocks


@pytest.mark.slow
def test_jobs_of_a_queue_share_the_store(tmp_path):
    (script,) = blocks((ROOT / "notebooks" / "archives.md").read_text(), "bash")
    rig = example_paths().rig
    (tmp_path / "rig.toml").write_text(rig.read_text())
    (tmp_path / "runs").mkdir()
    machine = fj.Rig.from_toml(rig).oscillator(fj.friction.Coulomb(0.05))
    for seed in range(6, 12):
        run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed)
        fj.write(run, tmp_path / "runs" / f"run_{seed}.npz")
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "SLURM_ARRAY_TASK_COUNT": "2",
    }
    jobs = [
        subprocess.Popen(["bash", "-c", script], cwd=tmp_path, env={**environment, "SLURM_ARRAY_TASK_ID": number})
        for number in "12"
    ]
    assert [job.wait() for job in jobs] == [0, 0]
    archive = fj.open_archive(tmp_path / "results")
    assert archive.counts["ok"] == len(archive) == 6
    parts = [pd.read_parquet(part) for part in (tmp_path / "results" / "parts").iterdir()]
    assert len(pd.concat(parts)) == 6
    assert len(set(archive.to_dataframe()["worker"])) == 2
