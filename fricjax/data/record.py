"""A record is a trace with its history: where it came from, in which units, and every step that has changed it since.

The trace carries the arrays; the record carries what a reader of a report asks about them. A record is never changed in
place: each step of preprocessing returns a new one with one more line in its log.
"""

import dataclasses
import functools
import html
from typing import TYPE_CHECKING, Any

import numpy as np

from .segmentation import Segmentation, segment

if TYPE_CHECKING:
    from .trace import Trace


@dataclasses.dataclass(frozen=True)
class Step:
    """One logged step: its name, the parameters it was called with, and what it did, in words and numbers."""

    name: str
    parameters: dict[str, Any]
    effect: str

    def __str__(self) -> str:
        given = ", ".join(f"{key}={value!r}" for key, value in self.parameters.items() if value is not None)
        return f"{self.name}({given}): {self.effect}"


@dataclasses.dataclass(frozen=True)
class Record:
    """A measured or synthetic run.

    **Fields:**

    - `trace`: times [s] and displacements [m] or angles [rad].
    - `meta`: plain facts that JSON can hold: `source`, `format`, `columns`, `units` (as found in the source),
      `quantity` (`"m"` or `"rad"`), `release_time` [s] where it is known, and what later steps add.
    - `log`: the steps that led here, in order.
    """

    trace: "Trace"
    meta: dict[str, Any] = dataclasses.field(default_factory=dict)
    log: tuple[Step, ...] = ()

    @functools.cached_property
    def segmentation(self) -> Segmentation:
        """Hold, release, reversals, rest and noise of the trace, found when first asked for and kept; see `segment`.

        Raises:
            DataError: x is constant, or there are too few samples, altogether or per half-cycle.
        """
        return segment(self.trace.t, self.trace.x, self.trace.sigma, self.trace.mask)

    @property
    def release(self) -> float | None:
        """Time at which the mass was let go [s], where it is logged; otherwise None."""
        return self.meta.get("release_time")

    @property
    def quantity(self) -> str:
        """The unit of the displacement: `"m"`, or `"rad"` for a rotary rig."""
        return self.meta.get("quantity", "m")

    @property
    def doubts(self) -> tuple[str, ...]:
        """What was taken for granted when the record was read, in sentences: a unit that its file does not name."""
        return tuple(self.meta.get("warnings", ()))

    def with_step(self, step: Step, *, trace: "Trace | None" = None, **meta: Any) -> "Record":
        """Returns the record after `step`: with the new trace (if any), the changed facts, and one more line of log."""
        return Record(self.trace if trace is None else trace, {**self.meta, **meta}, (*self.log, step))

    def summary(self) -> str:
        """The record in a few lines of plain text: source, size, span, and the log."""
        lines = [f"{name:<10}{value}" for name, value in _facts(self)]
        lines += [f"{'log' if i == 0 else '':<10}{step}" for i, step in enumerate(self.log)]
        return "\n".join(lines)

    def __repr__(self) -> str:
        source = self.meta.get("source", "in memory")
        span = f"{float(self.trace.t[0]):.6g}..{float(self.trace.t[-1]):.6g} s"
        return f"Record({source!r}, {self.trace.n} samples, {span}, x in {self.quantity}, {len(self.log)} steps)"

    def _repr_html_(self) -> str:
        rows = [*_facts(self), *(("step", str(step)) for step in self.log)]
        cells = "".join(f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in rows)
        return f"<table>{cells}</table>"


def _facts(record: Record) -> list[tuple[str, str]]:
    trace, unit = record.trace, record.quantity
    used = np.asarray(trace.x)[np.asarray(trace.mask)]
    span = f"{used.min():.9g} to {used.max():.9g} {unit}" if used.size else "no sample is used"
    facts = [
        ("source", f"{record.meta.get('source', 'in memory')} ({record.meta.get('format', '-')})"),
        ("samples", f"{trace.n}, {int(trace.n_used)} used"),
        ("time", f"{float(trace.t[0]):.9g} to {float(trace.t[-1]):.9g} s"),
        ("x", span),
        ("sigma", "not known" if trace.sigma is None else f"{float(np.median(np.asarray(trace.sigma))):.3g} {unit}"),
    ]
    return facts if record.release is None else [*facts, ("release", f"{record.release:.9g} s")]


def trace_of(data: "Record | Trace") -> "Trace":
    """The trace of a record; a trace itself."""
    return data.trace if isinstance(data, Record) else data


def segmentation_of(data: "Record | Trace") -> Segmentation:
    """The segmentation kept with a record, or that of a bare trace."""
    return data.segmentation if isinstance(data, Record) else segment(data.t, data.x, data.sigma, data.mask)
