from .archive import Archive, open_archive, results
from .driver import batch, run
from .execute import scheduler, workers
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
    "workers",
]
