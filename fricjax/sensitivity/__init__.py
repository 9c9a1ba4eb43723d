"""What a run can tell: derivatives of the motion, and the information of a planned run about each coefficient."""

from .directions import Direction
from .fisher import fisher
from .information import Information
from .local import local

__all__ = ["Direction", "Information", "fisher", "local"]
