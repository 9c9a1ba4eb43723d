from .campaign import Design, design
from .directions import Direction
from .fisher import fisher
from .information import Information
from .local import local
from .stops import NextRelease, Outcome, next_release

__all__ = [
    "Design",
    "Direction",
    "Information",
    "NextRelease",
    "Outcome",
    "design",
    "fisher",
    "local",
    "next_release",
]
