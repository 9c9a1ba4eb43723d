from .inspect import Inspection, inspect
from .observation import Observation
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
from .read import example_paths, read
from .record import Record, Step
from .repair import find_clock_faults, find_dropouts, find_slips, mask_dropouts, repair_clock, repair_slips
from .segmentation import Segmentation, rest_spectrum, segment
from .trace import Trace
from .write import write

__all__ = [
    "Inspection",
    "Observation",
    "Record",
    "Segmentation",
    "Step",
    "Trace",
    "convert_unit",
    "crop",
    "estimate_noise",
    "example_paths",
    "find_clock_faults",
    "find_dropouts",
    "find_first_reversal",
    "find_release",
    "find_rest",
    "find_slips",
    "flip_sign",
    "inspect",
    "mask_dropouts",
    "read",
    "repair_clock",
    "repair_slips",
    "rest_spectrum",
    "segment",
    "segment_record",
    "write",
]
