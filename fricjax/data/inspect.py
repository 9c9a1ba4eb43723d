"""Inspection of a record before a fit.

It reports rate, gaps, noise, amplitude, cycles, release and rest. Warnings name scales that no friction oscillator has,
together with the usual cause: a wrong unit.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..show import Report, Reported, Style, engineering
from .gather import record_of
from .record import Record
from .repair import reported_faults
from .segmentation.decay import Segmentation

REGULAR = 1e-3  # largest relative deviation of an interval from the median interval
GAP = 1.5  # a gap is an interval longer than this multiple of the median interval
# Springs of laboratory rigs bend by millimetres or centimetres. A pendulum turns over beyond half a turn to each side.
_LARGEST_AMPLITUDE, _LARGEST_SWING = 0.5, 2 * math.pi
# Fast interferometers count fringes up to about 5 m/s.
_LARGEST_SPEED = 5.0
_GRAVITY = 9.80665  # m/s^2
# Shot noise of a milliwatt of red light, lambda/(4 pi) sqrt(2 h nu/P) = 1.3e-15 m/sqrt(Hz).
_LEAST_DENSITY = 1e-15
# Ratio of noise to amplitude below which a record is computed: its only noise is rounding.
_COMPUTED = 1e-10
_OF_READING = ("noise", "white_noise", "resolution")
_OF_MOTION = (
    "amplitude", "cycles", "n_half_cycles", "open", "half_period",
    "frequency", "release", "first_reversal", "rest", "rest_position",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Inspection(Reported):
    """Result of `inspect`: times in s, frequencies in Hz, readings in `unit`.

    Noise, hum and resolution are those of the reading. `amplitude` and `rest_position` are displacements in `motion`,
    "m" or "rad". They are approximate if `observation` is not "displacement". The fields include those of a
    `Segmentation`. Fields of the record are `samples`, `masked`, `duration`, `rate`, `regular` (even spacing), `gaps`
    and `longest_gap`. `record` is the inspected record, and `warnings` are sentences about doubtful values.

    Examples:
        >>> import fricjax as fj
        >>> inspection = fj.data.inspect(fj.data.example_paths().run)
        >>> inspection.n_half_cycles, round(inspection.frequency, 2), inspection.warnings
        (13, 12.6, ())
    """

    source: str
    unit: str
    motion: str
    observation: str
    samples: int
    masked: int
    duration: float
    rate: float
    regular: bool
    gaps: int
    longest_gap: float
    noise: float
    white_noise: float
    lines: tuple[tuple[float, float], ...]
    resolution: float
    amplitude: float
    cycles: float
    n_half_cycles: int
    open: tuple[int, ...]
    half_period: float
    frequency: float
    release: float
    first_reversal: float | None
    rest: float | None
    rest_position: float | None
    record: Record = dataclasses.field(repr=False, compare=False)
    warnings: tuple[str, ...] = ()

    def report(self) -> Report:
        """Report the fields in words, with the warnings."""
        data = {name: value for name, value in vars(self).items() if name != "record"}
        times = ("duration", "longest_gap", "half_period", "release", "first_reversal", "rest")
        units: dict[str, str] = dict.fromkeys(times, "s")
        units |= dict.fromkeys(_OF_READING, self.unit) | dict.fromkeys(("amplitude", "rest_position"), self.motion)
        units |= dict.fromkeys(("rate", "frequency"), "Hz")
        return Report([], _rows(self), warnings=self.warnings, heading="Record", data=data, units=units)

    def thumbnails(self) -> Sequence[str]:
        return self.record.thumbnails()

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the record with release, reversals, rest and the rest's spectrum.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        return self.record.plot(style=style)

    def __str__(self) -> str:
        return self.summary()


def inspect(record: Any) -> Inspection:
    """Inspect a record, or any source that `fricjax.read` accepts without options.

    Raises:
        DataError: x is constant, or sampled too sparsely to resolve its half-cycles.

    Examples:
        >>> import fricjax as fj
        >>> print(fj.data.inspect(fj.data.example_paths().run).summary().splitlines()[3])
        rate:           5000 Hz, regular
    """
    record = record_of(record)
    trace, segmentation = record.trace, record.segmentation
    steps = np.diff(record.t)
    step = float(np.median(steps))
    used = np.diff(record.t[record.mask])
    gaps = used[used > GAP * step]
    return Inspection(
        source=record.name or "in memory",
        unit=record.quantity,
        motion=record.observation.motion,
        observation=record.observation.kind,
        samples=trace.n,
        masked=trace.n - int(trace.n_used),
        duration=float(trace.duration),
        rate=record.rate,
        regular=bool(np.all(np.abs(steps - step) <= REGULAR * step)),
        gaps=int(gaps.size),
        longest_gap=float(gaps.max()) if gaps.size else 0.0,
        **{name: segmentation.gain * getattr(segmentation, name) for name in _OF_READING},
        lines=tuple((frequency, segmentation.gain * size) for frequency, size in segmentation.lines),
        **{name: getattr(segmentation, name) for name in _OF_MOTION},
        record=record,
        warnings=(
            *record.doubts,
            *reported_faults(record).values(),
            *implausible_scale(segmentation, step, angular=record.observation.motion == "rad"),
        ),
    )


def _rows(inspection: Inspection) -> list[tuple[str, str]]:
    unit = inspection.unit
    spacing = "regular" if inspection.regular else "irregular"
    gaps = f"{inspection.gaps}, the longest {inspection.longest_gap:.4g} s" if inspection.gaps else "none"
    direct, rest = inspection.observation == "displacement", "none: the record ends in motion"
    if inspection.rest is not None:
        place = engineering(inspection.rest_position or 0.0, inspection.motion, 6)
        # An integral has no zero.
        rest = f"{inspection.rest:.6g} s at {place}" if direct else f"{inspection.rest:.6g} s"
    noise, white = (engineering(size, unit) for size in (inspection.noise, inspection.white_noise))
    hum = ", ".join(f"{engineering(size, unit)} at {frequency:.4g} Hz" for frequency, size in inspection.lines)
    others = ", ".join(str(inspection.n_half_cycles + step) for step in inspection.open)
    possibly = f", possibly {others}" if others else ""
    return [
        ("source", inspection.source),
        *([] if direct else [("reading", f"{inspection.record.observation.name.lower()} in {unit}")]),
        ("samples", f"{inspection.samples}, {inspection.masked} masked"),
        ("duration", f"{inspection.duration:.6g} s"),
        ("rate", f"{inspection.rate:.6g} Hz, {spacing}"),
        ("gaps", gaps),
        ("noise", f"{noise} rms, of which {white} white"),
        ("hum at rest", hum or "none seen"),
        ("resolution", engineering(inspection.resolution, unit) if inspection.resolution else "no steps seen"),
        ("amplitude", engineering(inspection.amplitude, inspection.motion, 6 if direct else 3)),
        ("half-cycles", f"{inspection.n_half_cycles} ({inspection.cycles:g} cycles){possibly}"),
        ("half-period", f"{inspection.half_period:.6g} s ({inspection.frequency:.6g} Hz)"),
        ("release", f"{inspection.release:.6g} s"),
        ("first reversal", "none" if inspection.first_reversal is None else f"{inspection.first_reversal:.6g} s"),
        ("rest", rest),
    ]


def implausible_scale(segmentation: Segmentation, interval: float, *, angular: bool, where: str = "") -> Iterator[str]:
    """Yield a warning for each implausible scale of a record.

    `interval` is the time between samples [s]; `angular` is True for an angle; `where` names the record: " of run 2".
    """
    amplitude, omega = segmentation.amplitude, math.pi / segmentation.half_period
    if angular:
        if 2 * amplitude > _LARGEST_SWING:
            yield (
                f"The swing{where} spans {2 * amplitude:.3g} rad, more than a full turn: were degrees taken for "
                "radians?"
            )
        return
    if amplitude > _LARGEST_AMPLITUDE:
        yield (
            f"The amplitude{where} of {engineering(amplitude, 'm')} is larger than that of any friction "
            "oscillator: check the unit of the displacement."
        )
    elif amplitude * omega > _LARGEST_SPEED:
        yield (
            f"The motion{where} would reach {amplitude * omega:.3g} m/s and "
            f"{amplitude * omega**2 / _GRAVITY:.3g} times gravity, faster than an interferometer follows: check the "
            "units of displacement and time."
        )
    density = segmentation.white_noise * math.sqrt(2.0 * interval)
    if _COMPUTED * amplitude < segmentation.white_noise and density < _LEAST_DENSITY:
        yield (
            f"The noise{where} of {density:.1e} m/sqrt(Hz) over its bandwidth is less than that of a milliwatt of "
            "light: check the unit of the displacement."
        )
