from .campaign import Design, design
from .curves import Curves, curves
from .directions import Direction
from .fisher import fisher
from .information import Information
from .local import local
from .optimal import OptimalRuns, Point, optimal_runs
from .stops import NextRelease, Outcome, next_release
from .variance import Sobol, sobol

__all__ = [
    "Curves",
    "Design",
    "Direction",
    "Information",
    "NextRelease",
    "OptimalRuns",
    "Outcome",
    "Point",
    "Sobol",
    "curves",
    "design",
    "fisher",
    "local",
    "next_release",
    "optimal_runs",
    "sobol",
]
