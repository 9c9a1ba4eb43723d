"""What a record is like, before anything is fitted to it: rate, gaps, noise, amplitude, cycles, release, rest."""

import dataclasses
import html
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..show import engineering
from .gather import record_of
from .segmentation.decay import Segmentation

REGULAR = 1e-3  # largest deviation of an interval from the median one, relative
GAP = 1.5  # intervals longer than this many median ones


@dataclasses.dataclass(frozen=True)
class Inspection:
    """The findings of `inspect`: times in s, frequencies in Hz, displacements in `unit` ("m" or "rad")."""

    source: str
    unit: str
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
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The findings as plain values for JSON."""
        return dataclasses.asdict(self)

    def summary(self) -> str:
        """The findings as a table of plain text, with what is doubtful below it."""
        lines = [f"{name:<22}{value}" for name, value in _rows(self)]
        return "\n".join([*lines, *(f"! {sentence}" for sentence in self.warnings)])

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        shown = [*_rows(self), *(("warning", sentence) for sentence in self.warnings)]
        rows = (f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in shown)
        return f"<table>{''.join(rows)}</table>"


def inspect(record: Any) -> Inspection:
    """Inspects a record, or whatever `fricjax.read` makes one of without options.

    Raises:
        DataError: x is constant, or sampled too sparsely to tell its half-cycles.

    ```python
    print(fricjax.data.inspect("run.csv"))
    ```
    """
    record = record_of(record)
    trace, found = record.trace, record.segmentation
    t = np.asarray(trace.t)
    used = t[np.asarray(trace.mask)]
    steps = np.diff(t)
    step = float(np.median(steps))
    holes = np.diff(used)[np.diff(used) > GAP * step]
    return Inspection(
        source=record.name or "in memory",
        unit=record.quantity,
        samples=trace.n,
        masked=trace.n - int(trace.n_used),
        duration=float(trace.duration),
        rate=record.rate,
        regular=bool(np.all(np.abs(steps - step) <= REGULAR * step)),
        gaps=int(holes.size),
        longest_gap=float(holes.max()) if holes.size else 0.0,
        noise=found.noise,
        white_noise=found.white_noise,
        lines=found.lines,
        resolution=found.resolution,
        amplitude=found.amplitude,
        cycles=found.cycles,
        n_half_cycles=found.n_half_cycles,
        open=found.open,
        half_period=found.half_period,
        frequency=0.5 / found.half_period,
        release=found.release,
        first_reversal=found.first_reversal,
        rest=found.rest,
        rest_position=found.rest_position,
        warnings=(*record.doubts, *implausible_scale(found, step, angular=record.quantity == "rad")),
    )


def _or_else(found: Inspection) -> str:
    """The numbers of half-cycles that the noise leaves possible beside the likeliest one."""
    others = ", ".join(str(found.n_half_cycles + step) for step in found.open)
    return f", possibly {others}" if others else ""


def _rows(found: Inspection) -> list[tuple[str, str]]:
    unit = found.unit
    spacing = "regular" if found.regular else "irregular"
    gaps = f"{found.gaps}, the longest {found.longest_gap:.4g} s" if found.gaps else "none"
    rest = "none: the record ends in motion"
    if found.rest is not None:
        rest = f"{found.rest:.6g} s at {found.rest_position:.6g} {unit}"
    return [
        ("source", found.source),
        ("samples", f"{found.samples}, {found.masked} masked"),
        ("duration", f"{found.duration:.6g} s"),
        ("rate", f"{found.rate:.6g} Hz, {spacing}"),
        ("gaps", gaps),
        ("noise", f"{found.noise:.3g} {unit} rms, of which {found.white_noise:.3g} {unit} white"),
        ("hum at rest", ", ".join(f"{size:.3g} {unit} at {at:.4g} Hz" for at, size in found.lines) or "none seen"),
        ("resolution", f"{found.resolution:.3g} {unit}" if found.resolution else "no steps seen"),
        ("amplitude", f"{found.amplitude:.6g} {unit}"),
        ("half-cycles", f"{found.n_half_cycles} ({found.cycles:g} cycles){_or_else(found)}"),
        ("half-period", f"{found.half_period:.6g} s ({found.frequency:.6g} Hz)"),
        ("release", f"{found.release:.6g} s"),
        ("first reversal", "none" if found.first_reversal is None else f"{found.first_reversal:.6g} s"),
        ("rest", rest),
    ]


# Springs of laboratory rigs bend by millimetres or centimetres, and a pendulum turns over beyond a half-turn to each
# side.
_LARGEST_AMPLITUDE, _LARGEST_SWING = 0.5, 2 * math.pi
# The electronics of fast interferometers count fringes up to some 5 m/s.
_LARGEST_SPEED = 5.0
_GRAVITY = 9.80665  # m/s^2
# Shot noise of a milliwatt of red light, lambda/(4 pi) sqrt(2 h nu/P) = 1.3e-15 m/sqrt(Hz).
_LEAST_DENSITY = 1e-15
# Noise relative to the amplitude below which a record is a computed one, without noise but its rounding.
_COMPUTED = 1e-10


def implausible_scale(found: Segmentation, interval: float, *, angular: bool, where: str = "") -> Iterator[str]:
    """A sentence for each scale of a record that cannot be true.

    Args:
        found: the anatomy of the record.
        interval: time between samples [s].
        angular: whether the displacement is an angle.
        where: which record, for the sentence: " of run 2".
    """
    amplitude, omega = found.amplitude, math.pi / found.half_period
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
    density = found.white_noise * math.sqrt(2.0 * interval)
    if _COMPUTED * amplitude < found.white_noise and density < _LEAST_DENSITY:
        yield (
            f"The noise{where} of {density:.1e} m/sqrt(Hz) over its bandwidth is less than that of a milliwatt of "
            "light: check the unit of the displacement."
        )
