"""A record: a trace with its source, units and change log.

The trace carries the arrays; the record carries the information for reports. A record is immutable: each preprocessing
step returns a new record with one more log entry.
"""

import dataclasses
import functools
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ..errors import DataError, first_of
from ..show import Report, Reported, Style, styled
from ..show.tables import Variable, dataset
from ..show.thumbnail import Curve, curves_svg
from .observation import Observation, observation_of
from .segmentation.decay import Segmentation, segment

if TYPE_CHECKING:
    from .trace import Trace


# Largest number of runs that a report names; a dozen would be wider than a page.
_LISTED = 4


@dataclasses.dataclass(frozen=True)
class Step:
    """One log entry: name, parameters and effect of a step.

    The effect is a text with numbers.

    Examples:
        >>> from fricjax.data import Step
        >>> print(Step("crop", {"start": 0.1, "stop": None}, "kept 900 of 1000 samples"))
        crop(start=0.1): kept 900 of 1000 samples
    """

    name: str
    parameters: dict[str, Any]
    effect: str

    def __str__(self) -> str:
        arguments = ", ".join(f"{key}={value!r}" for key, value in self.parameters.items() if value is not None)
        return f"{self.name}({arguments}): {self.effect}"


@dataclasses.dataclass(frozen=True, init=False)
class Record(Reported):
    """A measured or synthetic run.

    Create it from a trace, its metadata and its log, or from arrays: `Record(t, x)`, `Record(x=x, rate=5000.0)`.
    `fricjax.read` reads files, tables and data in other units.

    **Fields:**

    - `trace`: times [s] and the reading: displacements [m] or angles [rad], or another `observation` of the motion.
    - `meta`: metadata that JSON can store: `source`, `format`, `columns`, `units` (as found in the source),
      `quantity` (unit of the reading, such as `"m"` or `"rad/s"`), `projection` (`length` and `angle` of a filmed
      pendulum), `release_time` [s] if known, and the entries that later steps add.
    - `log`: all steps so far, in order.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> record.name, record.quantity, round(record.rate), round(record.duration, 4)
        ('synthetic run', 'm', 5000, 0.7998)
        >>> fj.Record(x=record.x, rate=5000.0).segmentation.n_half_cycles
        13
    """

    trace: "Trace"
    meta: dict[str, Any] = dataclasses.field(default_factory=dict)
    log: tuple[Step, ...] = ()

    @overload
    def __init__(self, trace: "Trace", meta: dict[str, Any] | None = None, log: Sequence[Step] = ()) -> None: ...
    @overload
    def __init__(
        self, t: Any = None, x: Any = None, sigma: Any = None, mask: Any = None, *, rate: float | None = None
    ) -> None: ...
    def __init__(self, *arguments: Any, **named: Any) -> None:
        from .trace import Trace

        if "trace" in named or (arguments and isinstance(arguments[0], Trace)):
            self._set(*arguments, **named)
        else:
            self._set(Trace(*arguments, **named))

    def _set(self, trace: "Trace", meta: dict[str, Any] | None = None, log: Sequence[Step] = ()) -> None:
        for name, value in (("trace", trace), ("meta", {} if meta is None else meta), ("log", tuple(log))):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Number of samples, masked ones included."""
        return self.trace.n

    @property
    def t(self) -> np.ndarray:
        """Times of the samples [s], shape (n,)."""
        return np.asarray(self.trace.t)

    @property
    def x(self) -> np.ndarray:
        """Reading in SI units (`quantity`), shape (n,).

        Samples without a value are stored as 0; their `mask` is False.
        """
        return np.asarray(self.trace.x)

    @property
    def sigma(self) -> np.ndarray | None:
        """Standard deviation of the noise of `x`, one number or shape (n,).

        None if unknown.
        """
        return None if self.trace.sigma is None else np.asarray(self.trace.sigma)

    @property
    def mask(self) -> np.ndarray:
        """True where a sample is used, shape (n,)."""
        return np.asarray(self.trace.mask)

    @property
    def rate(self) -> float:
        """Samples per second, from the median interval."""
        return 1.0 / float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.trace.duration)

    @property
    def name(self) -> str:
        """Name of the source and its run; may be empty."""
        return ", ".join(str(self.meta[key]) for key in ("source", "run") if self.meta.get(key))

    @functools.cached_property
    def segmentation(self) -> Segmentation:
        """Hold, release, reversals, rest and noise of the trace; see `segment`.

        It is computed at the first access and then cached.

        Raises:
            DataError: x is constant, there are too few samples, altogether or per half-cycle, or the clock jumps.
        """
        return self._motion[0]

    @functools.cached_property
    def _motion(self) -> tuple[Segmentation, np.ndarray]:
        """Segmentation and displacement."""
        trace, observation = self.trace, self.observation
        try:
            if observation.kind == "displacement":
                return segment(trace.t, trace.x, trace.sigma, trace.mask), self.x
            from .segmentation.reading import segment_reading

            return segment_reading(observation, self.t, self.x, self.sigma, self.mask)
        except DataError as error:
            raise DataError(f"{self.name}: {error}" if self.name else str(error)) from error

    @functools.cached_property
    def observation(self) -> Observation:
        """Map from the motion to the reading, from its unit."""
        return observation_of(self.meta)

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the mass [m or rad], shape (n,).

        It is approximate if the record is another `observation`: start values of a fit follow from it, not its result.

        Raises:
            DataError: as for `segmentation`.
        """
        return self.x if self.observation.kind == "displacement" else self._motion[1]

    @property
    def release(self) -> float | None:
        """Time of the release [s] if the record states it; otherwise None."""
        return self.meta.get("release_time")

    @property
    def quantity(self) -> str:
        """SI unit of the reading: `"m"`, or `"rad"` for a rotary rig.

        It is such as `"rad/s"` for another `observation`.
        """
        return self.meta.get("quantity", "m")

    @property
    def doubts(self) -> tuple[str, ...]:
        """Assumptions made while reading, one sentence each: missing units."""
        return tuple(self.meta.get("warnings", ()))

    def with_step(self, step: Step, *, trace: "Trace | None" = None, **meta: Any) -> "Record":
        """Return a new record after `step`.

        Args:
            step: the entry to append to the log.
            trace: the new trace; None: unchanged.
            **meta: metadata to change.
        """
        return Record(self.trace if trace is None else trace, {**self.meta, **meta}, (*self.log, step))

    def thumbnails(self) -> Sequence[str]:
        curve = Curve(self.t, np.where(self.mask, self.x, np.nan))
        return [curves_svg([curve], ("Time", "s"), (self.observation.name, self.quantity))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the trace, its segmentation and the spectrum of the rest.

        The figure marks hold, release, reversals and rest. If the record cannot be segmented (for example because the
        mass never moves), the figure shows only the trace, and its title states the reason.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        from .show import record_figure

        try:
            segmentation, title = self.segmentation, self.name
        except DataError as error:
            segmentation, title = None, str(error)
        return styled(record_figure(self.trace, self.observation, segmentation, title), style)

    def to_dataframe(self) -> Any:
        """Return a pandas table with the columns `t`, `x` and `used`.

        Its `attrs` hold the units and the source. Samples without a value are NaN. `fricjax.read` accepts the table,
        but `sigma` and samples that you masked are lost.
        """
        import pandas as pd

        x = np.where(~self.mask & (self.x == 0.0), np.nan, self.x)
        table = pd.DataFrame({"t": self.t, "x": x, "used": self.mask})
        table.attrs.update({"units": {"t": "s", "x": self.quantity}, "source": self.name})
        return table

    def to_xarray(self) -> Any:
        """Return an xarray dataset with `x` and `used` over `t`.

        `fricjax.read` accepts the dataset, as it does the table of `to_dataframe`.

        Raises:
            UsageError: xarray is not installed; the message shows how to install it.
        """
        x = np.where(~self.mask & (self.x == 0.0), np.nan, self.x)
        variables = {
            "x": Variable("t", x, self.quantity, self.observation.name.lower()),
            "used": Variable("t", self.mask),
        }
        if self.sigma is not None:
            sigma = np.broadcast_to(self.sigma, self.x.shape)
            variables["sigma"] = Variable("t", sigma, self.quantity, "standard deviation of the noise")
        coordinates = {"t": Variable("t", self.t, "s", "time")}
        return dataset(variables, coordinates, source=self.name, log=[str(step) for step in self.log])

    def report(self) -> Report:
        """Report source, size, time span and log."""
        facts = [*_facts(self), *(("log", str(step)) for step in self.log)]
        return Report([], facts, heading="Record", data={"meta": self.meta, "log": [str(step) for step in self.log]})

    def __repr__(self) -> str:
        source = self.name or "in memory"
        span = f"{float(self.trace.t[0]):.6g}..{float(self.trace.t[-1]):.6g} s"
        return f"Record({source!r}, {self.trace.n} samples, {span}, x in {self.quantity}, {len(self.log)} steps)"


def _facts(record: Record) -> list[tuple[str, str]]:
    trace, unit = record.trace, record.quantity
    used = np.asarray(trace.x)[np.asarray(trace.mask)]
    span = f"{used.min():.9g} to {used.max():.9g} {unit}" if used.size else "no sample is used"
    facts = [
        ("source", f"{record.name or 'in memory'} ({record.meta.get('format', '-')})"),
        ("samples", f"{trace.n}, {int(trace.n_used)} used"),
        ("time", f"{float(trace.t[0]):.9g} to {float(trace.t[-1]):.9g} s"),
        ("x", span),
        ("sigma", "not known" if trace.sigma is None else f"{float(np.median(np.asarray(trace.sigma))):.3g} {unit}"),
    ]
    return facts if record.release is None else [*facts, ("release", f"{record.release:.9g} s")]


def check_displacement(record: Record, aim: str) -> None:
    """Refuse a record that is no displacement; the message names the `aim`.

    Raises:
        DataError: the record is a velocity, an acceleration or a projection.
    """
    observation = record.observation
    if observation.kind != "displacement":
        name = record.name or "The record"
        raise DataError(
            f"{name} is a {observation.kind} in {observation.unit}, and {aim} needs a displacement or an angle. "
            "Fit it with fricjax.fit."
        )


def labels(names: Sequence[str]) -> tuple[str, ...]:
    """Return a label for each run.

    The label is the name of the run. Runs without a name or with a shared name get a number.
    """
    often = Counter(names)
    numbered = (f"run {i} ({name})" if name else f"run {i}" for i, name in enumerate(names))
    return tuple(name if often[name] == 1 and name else number for name, number in zip(names, numbered, strict=True))


def listed(sources: Sequence[str]) -> str:
    """Return the first few labels and the number of further runs."""
    return first_of(labels(sources), _LISTED)
