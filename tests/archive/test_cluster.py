"""SLURM jobs: script, settings, and a batch with a substitute for `sbatch`."""

import gc
import os
import re
import signal
import stat
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

import fricjax as fj
from fricjax.archive.cluster import Slurm, slurm, slurm_cluster
from fricjax.errors import UsageError
from tests.tables import check_rows

SETTINGS = """
workers = 4
per_job = 2
memory = "2 GB"
walltime = "02:00:00"
queue = "short"
account = "tribology"
interface = "lo"
shared = "{shared}"
directives = ["--constraint=skylake"]
prologue = ["module load python/3.12"]
"""
# Like the real one, it keeps the script and starts it in a new session, which `scancel` ends.
SBATCH = """#!/bin/sh
cp "$1" {folder}/job.sh
setsid sh {folder}/job.sh > {folder}/job.out 2>&1 < /dev/null &
echo "Submitted batch job $!"
"""
SCANCEL = "#!/bin/sh\necho $1 >> {folder}/cancelled\nkill -- -$1\n"


@pytest.fixture
def settings(tmp_path):
    """Write a file of settings with a new shared folder."""
    file = tmp_path / "slurm.toml"
    file.write_text(SETTINGS.format(shared=tmp_path / "shared"))
    return file


@pytest.fixture
def started(settings):
    """Provide settings for a test that starts a cluster."""
    yield settings
    # dask-jobqueue leaves its key files open; collect them here, before a test turns the warning into an error.
    gc.collect()


def test_the_script_of_a_job(started, tmp_path):
    given = Slurm.from_toml(started)
    with slurm_cluster(given, tmp_path) as cluster:
        script = cluster.job_script()
    lines = script.splitlines()
    assert given.jobs == 2
    for option in ("-J fricjax", "-p short", "-A tribology", "-n 1", "--cpus-per-task=2", "--mem=4G", "-t 02:00:00"):
        assert f"#SBATCH {option}" in lines
    assert lines.index("#SBATCH --constraint=skylake") < lines.index("module load python/3.12")
    assert f"export FRICJAX_CACHE_DIR={tmp_path}/shared/programs" in lines
    worker = lines[-1]
    assert re.search(r"dask_worker tls://127\.0\.0\.1:\d+ .*--nthreads 1 .*--nworkers 2 ", worker)
    assert "--preload fricjax.archive.distributed" in worker
    # The nodes find the keys in a private folder.
    (key,) = re.findall(r"--tls-key (\S+)", worker)
    assert key.startswith(str(tmp_path))


@pytest.mark.slow
def test_jobs_leave_the_handler_of_ctrl_c(started, tmp_path, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "dask_jobqueue"]:
        monkeypatch.delitem(sys.modules, name)
    handler = signal.getsignal(signal.SIGINT)
    with slurm_cluster(Slurm.from_toml(started), tmp_path):
        assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.slow
def test_jobs_are_started_from_any_thread(started, tmp_path):
    """Only the main thread may set the handler of Ctrl-C."""

    def script() -> str:
        with slurm_cluster(Slurm.from_toml(started), tmp_path) as cluster:
            return cluster.job_script()

    script()
    with ThreadPoolExecutor(1) as pool:
        assert "#SBATCH -J fricjax" in pool.submit(script).result()


@pytest.mark.slow
def test_a_batch_by_jobs(started, tmp_path, monkeypatch):
    commands = tmp_path / "commands"
    commands.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        (commands / name).write_text(text.format(folder=commands))
        (commands / name).chmod(stat.S_IRWXU)
    monkeypatch.setenv("PATH", f"{commands}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", os.getcwd())
    started.write_text(started.read_text().replace("workers = 4", "workers = 2"))
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    (tmp_path / "runs").mkdir()
    for seed in (0, 1):
        run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed)
        fj.write(run, tmp_path / "runs" / f"run_{seed}.npz")
    archive = fj.batch(tmp_path / "runs", tmp_path / "out", machine, execute=slurm(started))
    assert archive.counts["ok"] == 2
    assert str(os.getpid()) not in set(archive.to_dataframe()["worker"])
    assert (commands / "cancelled").read_text().strip().isdecimal()
    # The keys are removed.
    assert set(os.listdir(tmp_path / "shared")) <= {"programs"}


CHANGES = [
    ('queue = "short"', "que = 'short'|there is no key 'que' in a SLURM file. Did you mean 'queue'"),
    ("workers = 4", "|'workers' is missing; add a line such as workers = 16"),
    ("workers = 4", "workers = 0|'workers' must be one at least, but it is 0"),
    ("workers = 4", "workers = true|'workers' must be a whole number, but it is True"),
    ('"2 GB"', "\"much\"|'memory' is 'much'; write it as memory = \"2 GB\""),
    ('"02:00:00"', "\"2 hours\"|'walltime' is '2 hours'; write it as walltime = \"02:00:00\""),
    ('["--constraint=skylake"]', "\"--constraint=skylake\"|'directives' must be a list of texts"),
    ("workers = 4", "workers = |this is no valid TOML file"),
]


def test_wrong_settings_are_refused(settings):
    content = settings.read_text()

    def check(change, words):
        text, _, sentence = words.partition("|")
        settings.write_text(content.replace(change, text))
        with pytest.raises(UsageError, match=rf"slurm\.toml:? .*{re.escape(sentence)}"):
            slurm(settings)

    check_rows(check, CHANGES)


def test_no_slurm_and_no_file(settings, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match="There is no sbatch here"):
        slurm(settings)
    with pytest.raises(UsageError, match=r"There is no SLURM file '.*none\.toml'"):
        slurm(tmp_path / "none.toml")
