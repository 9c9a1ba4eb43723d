"""The fitted part of a record, its initial state, and its weights."""

import dataclasses
import functools
import itertools

import numpy as np

from ..data import Record, Segmentation, Trace
from ..data.observation import Observation
from ..errors import DataError, UsageError
from .settings import check_start, nuisances_of

NEVER = 10**9
ESTIMATED, OF_RESIDUALS = "estimated from the record", "scatter of the residuals"
# Deflection at the end of a half-cycle over that at its start, below which the mass may creep to rest.
_CROSSED = 0.16
# Duration of a half-cycle over that of the one before, below which the mass oscillates on the contact, not the spring.
_ABRUPT = 0.75
# Distance from the middle of a rest, in steps of rounding, that flips between two adjacent values do not reach.
_MOVED = 1.5
# Variance of rounded samples, in squared steps, with white noise of half a step. It averages their errors to
# exp(-pi^2/2)/pi = 0.2 % of a step; less noise leaves up to half a step (Widrow and Kollar 2008, Quantization Noise).
DITHERED = 1 / 4 + 1 / 12
# Fewest turning points on alternating sides that determine equilibrium and decay.
_FEWEST = 3


@dataclasses.dataclass(frozen=True)
class Window:
    """The fitted part of one record.

    Attributes:
        trace: the whole record; `observation`: map from the motion to its reading.
        segmentation: reversals, rest and noise of the record.
        origin: zero of the time of this run [s].
        t_start: time of the initial state of the computed motion [s].
        used: True for fitted samples; `moving`: the same without the rest.
        repeated: True for samples that are dropped because they repeat the rounding error of a used one.
        sigma: noise of each sample, in the unit of the reading; `sigma_source`: its source.
        half_cycles: number of half-cycles from `t_start` to the stop, or to the reversal at which the window ends;
            `NEVER` if the record ends in motion.
        nuisances: names of this run's free parameters.
        guesses: start values of x0, v0, offset, drift, t_release and z0.
        doubts: assumptions made when the record was read, in sentences.
        name: file name of the record; empty if unknown.
    """

    trace: Trace
    observation: Observation
    segmentation: Segmentation
    origin: float
    t_start: float
    used: np.ndarray
    moving: np.ndarray
    repeated: np.ndarray
    sigma: np.ndarray
    sigma_source: str
    half_cycles: int
    nuisances: tuple[str, ...]
    guesses: dict[str, float]
    doubts: tuple[str, ...] = ()
    name: str = ""

    @functools.cached_property
    def stated(self) -> float:
        """Typical noise of the fitted samples, stated or estimated from the record."""
        return float(np.median(self.sigma[self.used]))

    @property
    def quantity(self) -> str:
        """Unit of the reading."""
        return self.observation.unit

    @property
    def motion(self) -> str:
        """Unit of the displacement: "m" or "rad"."""
        return self.observation.motion

    @property
    def gain(self) -> float:
        """Reading over displacement: 1, or for a velocity the angular frequency."""
        return self.segmentation.gain

    @property
    def centre(self) -> float:
        """Estimated equilibrium, on the scale of the turning points."""
        return centre_of(self.observation, self.segmentation, self.guesses["offset"])

    @property
    def stopped(self) -> float:
        """Time of the run when the mass stops [s], else inf."""
        rest = self.segmentation.rest
        return np.inf if rest is None else rest - self.origin

    @property
    def completed(self) -> int:
        """Number of completed half-cycles in the window."""
        later = int(np.sum(self.segmentation.turning_times > self.t_start + self.segmentation.half_period / 4))
        return later + (self.segmentation.rest is not None)


def open_window(
    data: Record | Trace, start: str | float, nuisance: tuple[str, ...] | None, *, keeps_memory: bool, creeps: bool
) -> Window:
    """Find the fitted part of a record.

    Args:
        data: a record or a bare trace.
        start: "first_reversal", "release", or seconds from the first sample.
        nuisance: names of the run's free parameters; None for the default of `start`.
        keeps_memory: True if the law has internal states. These are known within a half-cycle only, so the fitted state
            is then half a half-cycle before the first reversal.
        creeps: True if the law creeps during a rest. Samples there are then dropped, and also a last half-cycle that
            creeps to rest before it has turned.

    Raises:
        DataError: a record without the motion that `start` requires.
        UsageError: an unknown `start` or nuisance parameter.
    """
    data = data if isinstance(data, Record) else Record(data)
    trace = data.trace
    t, x, mask = (np.asarray(a) for a in (trace.t, trace.x, trace.mask))
    segmentation, observation = data.segmentation, data.observation
    segmentation = without_ringing(segmentation) if keeps_memory else segmentation
    mode, t_start, t_first = _start(data, start, segmentation, t)
    if mode == "first_reversal" and keeps_memory:
        mode, t_start = "seconds", t_first - segmentation.half_period / 2
    last_reversal = _last_reversal(segmentation) if creeps else None
    end = segmentation.rest if last_reversal is None else float(segmentation.turning_times[last_reversal])
    moving = mask & (t >= t_first) & (t <= (np.inf if end is None else end))
    fitted = moving if creeps else mask & (t >= t_first)
    repeated = _repeated(t, x, fitted, segmentation)
    used = fitted & ~repeated
    sigma, source = _noise(trace, segmentation)
    nuisances = nuisances_of(mode, nuisance, keeps_memory, drifts=observation.order > 0)
    return Window(
        trace=trace,
        observation=observation,
        segmentation=segmentation,
        origin=t_first,
        t_start=t_start,
        used=used,
        moving=moving & used,
        repeated=repeated,
        sigma=sigma,
        sigma_source=source,
        half_cycles=_half_cycles(segmentation, t_start, last_reversal),
        nuisances=nuisances,
        guesses=_guess_state(data, segmentation, t_start, t_first, mode, nuisances),
        doubts=data.doubts,
        name=data.name,
    )


def without_ringing(segmentation: Segmentation) -> Segmentation:
    """Drop oscillations on the contact that holds the mass.

    Their half-cycles are much shorter than those on the spring. The first one begins at the reversal at which the mass
    comes to rest.
    """
    lasts = np.diff(segmentation.turning_times)
    abrupt = np.flatnonzero(lasts[1:] < _ABRUPT * lasts[:-1])
    if not abrupt.size:
        return segmentation
    last = int(abrupt[0]) + 1
    times = segmentation.turning_times[: last + 1]
    return dataclasses.replace(
        segmentation,
        turning_times=times[:-1],
        turning_points=segmentation.turning_points[:last],
        rest=float(times[-1]),
        rest_position=float(segmentation.turning_points[-1]),
        n_half_cycles=last + 1,
        half_period=float(np.median(np.diff(times))),
        open=(),
    )


def _start(data: Record, start: str | float, segmentation: Segmentation, t: np.ndarray) -> tuple[str, float, float]:
    """Return mode, time of the initial state, and time of the window."""
    if start == "first_reversal":
        if not segmentation.turning_times.size:
            raise DataError("The record holds no reversal to start from. Fit from the release: start='release'.")
        return "first_reversal", float(segmentation.turning_times[0]), float(segmentation.turning_times[0])
    if start == "release":
        at = float(t[0]) if data.release is None else float(data.release)
        if not at < t[-1]:
            raise DataError(f"The logged release at {at:.6g} s lies behind the record, which ends at {t[-1]:.6g} s.")
        return "release", at, at
    if isinstance(start, str):
        check_start(start)
    at = float(t[0]) + float(start)
    if not t[0] <= at < t[-1]:
        raise UsageError(f"start={start} s lies outside the record, which lasts {t[-1] - t[0]:.6g} s.")
    return "seconds", at, at


def _noise(trace: Trace, segmentation: Segmentation) -> tuple[np.ndarray, str]:
    if trace.sigma is not None:
        return np.broadcast_to(np.asarray(trace.sigma, float), trace.t.shape), "given"
    floor = segmentation.gain * max(segmentation.noise, 1e-12 * segmentation.amplitude)
    return np.full(trace.t.shape, floor), ESTIMATED


def _repeated(t: np.ndarray, x: np.ndarray, fitted: np.ndarray, segmentation: Segmentation) -> np.ndarray:
    """Return True for samples that repeat the rounding error of a rest.

    These are all samples but the first in a rest without noise that dithers the rounding. The rest here is the final
    part of the record that does not leave two adjacent values, wherever the stop was detected.
    """
    repeated = np.zeros(t.shape, bool)
    resting = fitted & (t > (np.inf if segmentation.rest is None else segmentation.rest))
    if not resting.any() or not segmentation.resolution > 0:
        return repeated
    samples, step = np.flatnonzero(fitted), segmentation.gain * segmentation.resolution
    steps = (x[samples] - np.median(x[resting])) / step
    moves = np.flatnonzero(np.abs(steps) > _MOVED)
    rest = samples[moves[-1] + 1 :] if moves.size else samples
    if rest.size and np.var(x[rest]) <= DITHERED * step**2:
        repeated[rest[1:]] = True
    return repeated


def _last_reversal(segmentation: Segmentation) -> int | None:
    """Return the last reversal before a creeping half-cycle, if any.

    Such a half-cycle hardly crosses the equilibrium, or would not cross it with friction at full strength: a law that
    creeps is weaker at low speed, and moves the mass there and back long after its phase has become irregular. The end
    of the last half-cycle, which is no reversal, is extrapolated from the decay.
    """
    place = extremes(segmentation)[1] - equilibrium(segmentation)
    swing = np.abs(place)
    if swing.size < _FEWEST:
        return None
    # A creep that is detected as a reversal ends on the side on which it began.
    after = np.append(-np.sign(place[:-1]) * place[1:], 2 * swing[-1] - swing[-2])
    after = np.minimum(after, swing - 2 * _band(swing))
    short = np.flatnonzero(after < _CROSSED * swing)
    before = swing.size - segmentation.turning_points.size
    return int(short[0]) - before if short.size and short[0] >= _FEWEST - 1 else None


def _band(swing: np.ndarray) -> float:
    """Return the dead band from the decrease of successive deflections [m].

    They also lose amplitude to damping and drag.
    """
    # At high speed friction has its full strength.
    mean = (swing[:-1] + swing[1:]) / 2
    columns = np.stack([np.full(mean.size, 2.0), mean, mean**2 / swing[0]], axis=1)
    return float(non_negative(columns * mean[:, None], (swing[:-1] - swing[1:]) * mean)[0])


def non_negative(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Solve least squares with non-negative coefficients, shape (k,).

    It tries all subsets of the few columns, and keeps the best with positive coefficients. `scipy.optimize` has a
    solver for many columns, but its import takes longer than a first solve.
    """
    best, least, rounding = np.zeros(columns.shape[1]), values @ values, 1e-15 * (values @ values)
    for chosen in itertools.product((False, True), repeat=best.size):
        some = np.flatnonzero(chosen)
        solution = np.linalg.lstsq(columns[:, some], values, rcond=None)[0]
        left = values - columns[:, some] @ solution
        if np.all(solution > 0) and left @ left < least - rounding:
            best, least = np.zeros(best.size), left @ left
            best[some] = solution
    return best


def _half_cycles(segmentation: Segmentation, t_start: float, last_reversal: int | None) -> int:
    """Return half-cycles from the start to the stop or last reversal."""
    times = segmentation.turning_times[: None if last_reversal is None else last_reversal + 1]
    later = times > t_start + segmentation.half_period / 4
    if last_reversal is None and segmentation.rest is None:
        return NEVER
    return int(np.sum(later)) + (last_reversal is None)


def _guess_state(
    data: Record,
    segmentation: Segmentation,
    t_start: float,
    origin: float,
    mode: str,
    nuisances: tuple[str, ...],
) -> dict[str, float]:
    """Return start values of the run's parameters, in times relative to `origin`.

    An offset that is not free is zero.
    """
    t, x, mask = data.t, data.displacement, data.mask
    offset = _offset(data, segmentation) if "offset" in nuisances else 0.0
    first = (
        segmentation.turning_times.size > 0
        and abs(segmentation.turning_times[0] - t_start) < 1e-9 * segmentation.half_period
    )
    if first:
        x0, v0 = float(segmentation.turning_points[0]), 0.0
    else:
        near = mask & (t >= t_start) if mode == "release" else mask
        x0, v0 = _local_state(t[near], x[near], t_start, segmentation.half_period)
        # A release is from rest. A free v0 needs a start value away from the kink at zero.
        v0 = 0.0 if mode == "release" and "v0" not in nuisances else v0
    x0 -= centre_of(data.observation, segmentation, offset)
    return {"x0": x0, "v0": v0, "offset": offset, "drift": 0.0, "t_release": t_start - origin, "z0": 1.0}


def _offset(data: Record, segmentation: Segmentation) -> float:
    """Return the start value of the offset, as a reading."""
    if data.observation.kind == "displacement":
        return equilibrium(segmentation)
    value = data.displacement - equilibrium(segmentation)
    for _ in range(data.observation.order):
        value = np.gradient(value, data.t)
    return float(np.mean((data.x - data.observation.read(value))[data.mask]))


def centre_of(observation: Observation, segmentation: Segmentation, offset: float) -> float:
    """Return the equilibrium among the turning points [m or rad].

    The zero of a displacement sensor is its `offset`. The turning points of other readings follow from the motion, so
    only their own middle is known.
    """
    return offset if observation.kind == "displacement" else equilibrium(segmentation)


def _local_state(t: np.ndarray, x: np.ndarray, at: float, half_period: float) -> tuple[float, float]:
    """Return position and velocity at a time, from a local cubic fit."""
    near = np.abs(t - at) <= half_period / 6
    if near.sum() < 8:
        near = np.argsort(np.abs(t - at))[:8]
    width = half_period / 6
    cubic = np.polynomial.polynomial.polyfit((t[near] - at) / width, x[near], 3)
    return float(cubic[0]), float(cubic[1] / width)


def extremes(segmentation: Segmentation) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions of the reversals.

    If these are few, a release from rest is added.
    """
    times, points = segmentation.turning_times, segmentation.turning_points
    if points.size >= _FEWEST or segmentation.release_position is None:
        return times, points
    return np.append(segmentation.release, times), np.append(segmentation.release_position, points)


def equilibrium(segmentation: Segmentation) -> float:
    """Return the equilibrium of the spring, from turning points.

    For turning points on alternating sides it is (X[n-1] + 2 X[n] + X[n+1])/4.
    """
    _, points = extremes(segmentation)
    if points.size >= _FEWEST:
        return float(np.median((points[:-2] + 2 * points[1:-1] + points[2:]) / 4))
    if points.size == 2:
        return float(np.mean(points))
    return 0.0 if segmentation.rest_position is None else float(segmentation.rest_position)
