from .decay import Segmentation, segment
from .disturbance import rest_spectrum

__all__ = ["Segmentation", "rest_spectrum", "segment"]
