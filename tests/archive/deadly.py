"""Kinds of work that kill their process or take long."""

import os
import signal
import time
from pathlib import Path

from fricjax.archive.work import Work


class Deadly(Work):
    """Kill the worker at each file named "deadly..."."""

    def __call__(self, chunk):
        if any(Path(job.file).name.startswith("deadly") for job in chunk):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(chunk)


class Unlucky(Work):
    """Kill the worker once.

    A file next to the folder of runs marks that this has happened.
    """

    def __call__(self, chunk):
        mark = self.study.root.parent / "killed"
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(chunk)


class Slow(Work):
    """Sleep in each chunk without a text file."""

    def __call__(self, chunk):
        if not any(job.file.endswith(".csv") for job in chunk):
            time.sleep(8)
        return super().__call__(chunk)


def compiled(work, chunk):
    """Return statuses of a chunk; count loaded and compiled programs."""
    import jax

    from fricjax.archive.execute import attempt

    jax.config.update("jax_enable_x64", True)
    events = []
    jax.monitoring.register_event_listener(lambda event, **_: events.append(event))
    done = attempt(work, chunk)
    found, made = (events.count(f"/jax/compilation_cache/cache_{name}") for name in ("hits", "misses"))
    return [row["status"] for row in done.rows], found, made
