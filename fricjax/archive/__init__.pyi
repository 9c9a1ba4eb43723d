from .archive import Archive, open_archive, results
from .cluster import slurm
from .distributed import scheduler, workers
from .driver import batch, run
from .study import Law, Rule, Study

__all__ = [
    "Archive",
    "Law",
    "Rule",
    "Study",
    "batch",
    "open_archive",
    "results",
    "run",
    "scheduler",
    "slurm",
    "workers",
]
