"""Preprocessing steps: each returns a new record and logs its effect."""

import math

import numpy as np

from ..errors import DataError, UsageError, check_type
from ..numbers import scalar
from .record import Record, Step
from .segmentation.decay import Segmentation
from .trace import MINIMUM_SAMPLES, Trace
from .units import READING, TIME, factor, gravity


def segment_record(record: Record) -> Segmentation:
    """Return the segmentation of a record's trace, cached; see `segment`.

    Examples:
        >>> import fricjax as fj
        >>> fj.data.segment_record(fj.read(fj.data.example_paths().run)).n_half_cycles
        13
    """
    return record.segmentation


def crop(record: Record, start: float | None = None, stop: float | None = None) -> Record:
    """Keep the samples from `start` to `stop`.

    Args:
        record: the record to crop.
        start: first time to keep [s], included; None: the start of the record.
        stop: last time to keep [s], included; None: the end of the record.

    Raises:
        UsageError: `stop` is not after `start`.
        DataError: fewer than three samples would remain.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.data.crop(fj.read(fj.data.example_paths().run), start=0.1)
        >>> print(record.log[-1])
        crop(start=0.1): kept 3500 of 4000 samples, from 0.1 s to 0.7998 s
    """
    check_type("record", record, Record, "a Record")
    trace, t = record.trace, np.asarray(record.trace.t)
    low, high = (
        limit if value is None else scalar(name, value)
        for name, value, limit in (("start", start, -math.inf), ("stop", stop, math.inf))
    )
    if not high > low:
        raise UsageError(f"stop must come after start, but {start} s and {stop} s were given for them.")
    keep = (t >= low) & (t <= high)
    if keep.sum() < MINIMUM_SAMPLES:
        raise DataError(
            f"Only {int(keep.sum())} samples lie between {low:g} s and {high:g} s, but a trace needs "
            f"{MINIMUM_SAMPLES}; the record runs from {t[0]:g} s to {t[-1]:g} s."
        )
    sigma = np.asarray(trace.sigma)[keep] if trace.sigma is not None and np.ndim(trace.sigma) else trace.sigma
    kept = Trace(t[keep], np.asarray(trace.x)[keep], sigma, np.asarray(trace.mask)[keep])
    effect = f"kept {kept.n} of {trace.n} samples, from {kept.t[0]:.9g} s to {kept.t[-1]:.9g} s"
    return record.with_step(Step("crop", {"start": start, "stop": stop}, effect), trace=kept)


def convert_unit(record: Record, unit: str, time_unit: str | None = None) -> Record:
    """Convert a record from the stated units to SI units.

    Use it if the file did not state its units.

    Args:
        record: a record with values in the units of the file.
        unit: unit of the displacement, such as "um" or "deg"; the noise is converted with it.
        time_unit: unit of the times, None: seconds.

    Raises:
        DataError: a unit that does not fit; the message names examples that do.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.Record(x=2000 * np.cos(np.arange(500)), rate=5000.0)
        >>> fj.data.convert_unit(record, "um").x[0]
        np.float64(0.002)
    """
    check_type("record", record, Record, "a Record")
    trace = record.trace
    scale, quantity = factor(gravity(unit) or unit, READING, "the displacement")
    time_scale = 1.0 if time_unit is None else factor(time_unit, TIME, "the time")[0]
    sigma = None if trace.sigma is None else np.asarray(trace.sigma) * scale
    converted = Trace(np.asarray(trace.t) * time_scale, np.asarray(trace.x) * scale, sigma, trace.mask)
    scales = {"rest_position": scale, **{key: time_scale for key in record.meta if key.endswith("_time")}}
    moved = {key: each * scales[key] for key, each in record.meta.items() if key in scales and each is not None}
    step = Step(
        "convert_unit", {"unit": unit, "time_unit": time_unit}, f"x multiplied by {scale:g}, t by {time_scale:g}"
    )
    units = {"t": time_unit or "s", "x": unit}
    return record.with_step(step, trace=converted, quantity=quantity, units=units, warnings=[], **moved)


def flip_sign(record: Record) -> Record:
    """Reverse the direction of the displacement.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.Record(x=[1e-3, 0.0, -1e-3], rate=10.0)
        >>> fj.data.flip_sign(record).x.tolist()
        [-0.001, -0.0, 0.001]
    """
    trace = record.trace
    flipped = Trace(trace.t, -np.asarray(trace.x), trace.sigma, trace.mask)
    places = {key: -value for key, value in record.meta.items() if key == "rest_position" and value is not None}
    return record.with_step(Step("flip_sign", {}, "x multiplied by -1"), trace=flipped, **places)


def find_release(record: Record) -> Record:
    """Find the start of the free motion; store it as `meta["release_time"]` [s].

    Raises:
        DataError: x is constant, or sampled too sparsely.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.data.find_release(fj.read(fj.data.example_paths().run))
        >>> round(record.meta["release_time"], 3)
        0.051
    """
    release = record.segmentation.release
    since = release - float(record.t[0])
    effect = f"the free motion starts at {release:.9g} s, {since:.6g} s after the first sample"
    return record.with_step(Step("find_release", {}, effect), release_time=release)


def find_first_reversal(record: Record) -> Record:
    """Find the first reversal after the release.

    It is stored as `meta["first_reversal_time"]` [s].

    Raises:
        DataError: x is constant, sampled too sparsely, or without any reversal.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.data.find_first_reversal(fj.read(fj.data.example_paths().run))
        >>> round(record.meta["first_reversal_time"], 3)
        0.091
    """
    segmentation = record.segmentation
    if segmentation.first_reversal is None:
        raise DataError("The motion has no reversal after the release; use start='release'.")
    effect = (
        f"the first reversal is at {segmentation.first_reversal:.9g} s, "
        f"x = {segmentation.turning_points[0]:.9g} {record.quantity}"
    )
    return record.with_step(Step("find_first_reversal", {}, effect), first_reversal_time=segmentation.first_reversal)


def find_rest(record: Record) -> Record:
    """Find the final rest.

    It is stored as `meta["rest_time"]` [s] and `meta["rest_position"]`; both are None if the record ends in motion.

    Raises:
        DataError: x is constant, or sampled too sparsely.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.data.find_rest(fj.read(fj.data.example_paths().run))
        >>> f"{record.meta['rest_time']:.3f} s, {1e6 * record.meta['rest_position']:.2f} um"
        '0.567 s, 92.90 um'
    """
    segmentation = record.segmentation
    if segmentation.rest is None:
        effect = "the record ends while the mass still moves"
    else:
        effect = f"at rest from {segmentation.rest:.9g} s on, x = {segmentation.rest_position:.9g} {record.quantity}"
    step = Step("find_rest", {}, f"{effect}, after {segmentation.n_half_cycles} half-cycles")
    return record.with_step(step, rest_time=segmentation.rest, rest_position=segmentation.rest_position)


def estimate_noise(record: Record) -> Record:
    """Estimate the white noise from the samples and store it as `sigma`.

    Raises:
        DataError: x is constant or sampled too sparsely, or the record is free of noise.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.data.estimate_noise(fj.read(fj.data.example_paths().run))
        >>> f"{float(record.sigma):.0e}"
        '5e-09'
    """
    trace, segmentation = record.trace, record.segmentation
    if not segmentation.white_noise > 0:
        raise DataError("The record has no noise, as if it were computed; give sigma= yourself.")
    noisy = Trace(trace.t, trace.x, segmentation.noise, trace.mask)
    noise, resolution = segmentation.noise, segmentation.resolution
    effect = f"white noise of {noise:.4g} {record.quantity}, resolution {resolution:.4g} {record.quantity}"
    return record.with_step(Step("estimate_noise", {}, effect), trace=noisy, noise=segmentation.noise)
