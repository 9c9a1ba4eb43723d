"""Work that kills the process that does it, for files of a certain name or once, and work that is slow."""

import os
import signal
import time
from pathlib import Path

from fricjax.archive.work import Work


class Deadly(Work):
    """Kills its worker at each file whose name begins with "deadly"."""

    def __call__(self, chunk):
        if any(Path(job.file).name.startswith("deadly") for job in chunk.jobs):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(chunk)


class Unlucky(Work):
    """Kills its worker the first time that a file is at work: what its folder of runs remembers."""

    def __call__(self, chunk):
        mark = self.study.root.parent / "killed"
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(chunk)


class Slow(Work):
    """Takes its time for all chunks but those of text, of which others are at work when one is done."""

    def __call__(self, chunk):
        if not any(job.file.endswith(".csv") for job in chunk.jobs):
            time.sleep(8)
        return super().__call__(chunk)


def compiled(work, chunk):
    """Statuses of a chunk, and how many compiled functions are found kept and how many are made."""
    import jax

    from fricjax.archive.execute import attempt

    jax.config.update("jax_enable_x64", True)
    events = []
    jax.monitoring.register_event_listener(lambda event, **_: events.append(event))
    done = attempt(work, chunk)
    found, made = (events.count(f"/jax/compilation_cache/cache_{name}") for name in ("hits", "misses"))
    return [row["status"] for row in done.rows], found, made
