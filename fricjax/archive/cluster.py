"""SLURM jobs as workers of a batch, configured by a TOML file.

Jobs are submitted when a batch starts and cancelled when it ends. The keys of the file are:

    workers = 16               # total number of worker processes, one core each
    per_job = 8                # worker processes per job
    memory = "2 GB"            # per worker
    walltime = "02:00:00"      # per job
    queue = "short"
    account = "tribology"
    interface = "ib0"          # network between this machine and the nodes
    shared = "/scratch/me"     # folder visible to all machines, for keys and compiled programs
    directives = ["--constraint=skylake"]
    prologue = ["module load python/3.12"]

Only `workers`, `memory` and `walltime` are required.
"""

import contextlib
import dataclasses
import os
import re
import shlex
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from ..data.files import naming, read_toml
from ..errors import UsageError, brief, needed
from .distributed import PRELOAD, check_dask, of_clients
from .execute import Executor

# Required keys with examples.
_NEEDED = {"workers": "16", "memory": '"2 GB"', "walltime": '"02:00:00"'}
_KINDS: dict[Any, Any] = {
    int: (int, "a whole number"),
    str: (str, "a text"),
    tuple[str, ...]: (tuple, "a list of texts"),
}
# Format of text values, with examples.
_TEXTS = {"memory": (r"\d+(\.\d+)? ?[KMGT]i?B", "2 GB"), "walltime": (r"(\d+-)?\d+:\d\d(:\d\d)?", "02:00:00")}


@dataclasses.dataclass(frozen=True)
class Slurm:
    """Settings of SLURM jobs; the keys of the file.

    Attributes:
        workers: total number of worker processes, one core each.
        memory: memory per worker, such as "2 GB".
        walltime: time limit of a job, such as "02:00:00".
        per_job: worker processes per job.
        queue, account: queue and account of SLURM; empty for the defaults.
        interface: network interface between this machine and the nodes; empty for the default.
        shared: folder visible to all machines; empty for the current folder.
        directives: further options of ``sbatch``, such as "--constraint=skylake".
        prologue: lines of the script before the worker starts.

    Examples:
        >>> Slurm(workers=16, memory="2 GB", walltime="02:00:00", per_job=8).jobs
        2
    """

    workers: int
    memory: str
    walltime: str
    per_job: int = 1
    queue: str = ""
    account: str = ""
    interface: str = ""
    shared: str = ""
    directives: tuple[str, ...] = ()
    prologue: tuple[str, ...] = ()

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Self:
        """Read the settings from a TOML file.

        Raises:
            UsageError: missing file, invalid TOML, an unknown or a missing key, or an invalid value.
        """
        path = Path(path)
        table = read_toml(path, "SLURM", [field.name for field in dataclasses.fields(cls)], _NEEDED)
        with naming(path):
            values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in table.items()}
            return cls(**values)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value: Any = getattr(self, field.name)
            kind, words = _KINDS[field.type]
            if type(value) is not kind or (kind is tuple and not all(isinstance(each, str) for each in value)):
                raise UsageError(f"'{field.name}' must be {words}, but it is {brief(value)}.")
        for name in ("workers", "per_job"):
            if getattr(self, name) < 1:
                raise UsageError(f"'{name}' must be one at least, but it is {getattr(self, name)}.")
        for name, (pattern, example) in _TEXTS.items():
            value = getattr(self, name)
            if not re.fullmatch(pattern, value):
                raise UsageError(f"'{name}' is {brief(value)}; write it as {name} = \"{example}\".")

    @property
    def jobs(self) -> int:
        """Number of jobs to submit."""
        return -(-self.workers // self.per_job)

    @property
    def folder(self) -> Path:
        """Folder visible to all machines."""
        return Path(self.shared or ".").expanduser().resolve()


def slurm_cluster(settings: Slurm, keys: Path) -> Any:
    """Create a `SLURMCluster` of dask-jobqueue.

    Its `job_script()` returns the script of each job.

    Args:
        settings: settings of the jobs.
        keys: folder visible to all machines, for the keys of the connections.

    Raises:
        UsageError: dask-jobqueue is not installed, or the network interface does not exist.
    """
    # Importing dask_jobqueue replaces the handler of Ctrl-C by a silent exit; restore the handler of the caller.
    handler = signal.getsignal(signal.SIGINT)
    slurm = needed("A cluster", "dask_jobqueue.slurm", "cluster")
    if signal.getsignal(signal.SIGINT) is not handler:
        signal.signal(signal.SIGINT, handler)
    amount, unit = re.fullmatch(r"([\d.]+) ?(\w+)", settings.memory).groups()  # pyright: ignore[reportOptionalMemberAccess]
    # By default the cache of compiled programs is in the home folder, which the machines may share.
    programs = [f"export FRICJAX_CACHE_DIR={shlex.quote(str(settings.folder / 'programs'))}"] if settings.shared else []
    try:
        return slurm.SLURMCluster(
            cores=settings.per_job,
            processes=settings.per_job,
            memory=f"{float(amount) * settings.per_job:g} {unit}",
            walltime=settings.walltime,
            queue=settings.queue or None,
            account=settings.account or None,
            interface=settings.interface or None,
            job_extra_directives=list(settings.directives),
            job_script_prologue=[*settings.prologue, *programs],
            worker_extra_args=["--preload", PRELOAD],
            python=sys.executable,
            job_name="fricjax",
            scheduler_options={"dashboard_address": "127.0.0.1:0"},
            security=True,
            shared_temp_directory=str(keys),
        )
    except (ValueError, OSError, RuntimeError) as error:
        raise UsageError(f"Workers of SLURM cannot be prepared ({error}). Check the interface.") from error


def slurm(path: str | os.PathLike[str]) -> Executor:
    r"""Return an executor with workers that SLURM starts on demand.

    Their jobs are cancelled after the last chunk.

    Args:
        path: file of the settings.

    Raises:
        UsageError: the file is missing or invalid, a package is not installed, or SLURM is not available.

    Examples:
        >>> from pathlib import Path
        >>> _ = Path("slurm.toml").write_text("workers = 16\nmemory = '2 GB'\nwaltime = '02:00:00'\n")
        >>> slurm("slurm.toml")
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: slurm.toml: there is no key 'waltime' in a SLURM file. Did you mean 'walltime'? ...
    """
    settings = Slurm.from_toml(path)
    check_dask()
    if shutil.which("sbatch") is None:
        raise UsageError(
            "There is no sbatch here, by which jobs are handed in to SLURM. Start on a machine that has it."
        )
    return of_clients(lambda: _started(settings))


@contextlib.contextmanager
def _started(settings: Slurm) -> Iterator[Any]:
    from distributed import Client

    settings.folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(prefix=".fricjax-", dir=settings.folder) as keys,
        slurm_cluster(settings, Path(keys)) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        cluster.scale(settings.workers)
        # Jobs may wait in the queue for hours; Ctrl-C stops waiting.
        client.wait_for_workers(1)
        yield client
