from .examples import example_paths
from .inspect import Inspection, inspect
from .preprocess import (
    convert_unit,
    crop,
    estimate_noise,
    find_first_reversal,
    find_release,
    find_rest,
    flip_sign,
    segment_record,
)
from .read import read
from .record import Record, Step
from .segmentation import Segmentation, rest_spectrum, segment
from .trace import Trace
from .write import write

__all__ = [
    "Inspection",
    "Record",
    "Segmentation",
    "Step",
    "Trace",
    "convert_unit",
    "crop",
    "estimate_noise",
    "example_paths",
    "find_first_reversal",
    "find_release",
    "find_rest",
    "flip_sign",
    "inspect",
    "read",
    "rest_spectrum",
    "segment",
    "segment_record",
    "write",
]
