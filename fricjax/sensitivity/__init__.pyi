from .directions import Direction
from .fisher import fisher
from .information import Information
from .local import local

__all__ = ["Direction", "Information", "fisher", "local"]
