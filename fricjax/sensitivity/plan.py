"""Planned runs: machine, sample times, half-cycles, and the residual of a fit.

The derivatives of a planned run are those of a later fit. Therefore this module uses the residual, the engines and the
frozen mesh of :mod:`fricjax.fitting`. The number of half-cycles is constant: the motion depends smoothly on the
parameters for a constant number, and jumps if the number changes.
"""

import dataclasses
import math
from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import ArrayLike

from ..errors import UsageError
from ..estimation.space import Parameter, ParameterSpace
from ..fitting.mesh import with_mesh
from ..fitting.names import NUISANCES, find_leaf
from ..fitting.residual import Residual, Run
from ..fitting.settings import check_nuisance, check_once
from ..fitting.window import NEVER
from ..friction import Coulomb
from ..oscillator import Motion, Oscillator, ready, simulate
from ..oscillator.engines import AbstractEngine
from ..oscillator.oscillator import leaves_of
from ..oscillator.select import half_cycle_capacity, select_engine
from ..settings import check_sampling

TAIL = 0.05
"""Time at rest that a record should include after the stop [s]."""

# Least capacity for half-cycles, more than most runs have. Runs of one capacity share a compiled program.
_CAPACITY = 512


@dataclasses.dataclass(frozen=True)
class PlannedMotion:
    """Reversals and stop of a planned motion.

    Attributes:
        half_cycles: number of half-cycles until the stop; None if the mass does not stop.
        t_stop: time of the stop [s], inf without one.
        turning_points: start, reversals and stop in order [m], shape (half_cycles + 1,).
        like_coulomb: True if the other values are those of a Coulomb law with the same dynamic friction, because the
            law of the machine stops the mass only gradually.
    """

    half_cycles: int | None
    t_stop: float
    turning_points: np.ndarray
    like_coulomb: bool


@dataclasses.dataclass(frozen=True)
class Plan:
    """A planned run.

    Attributes:
        oscillator: the machine, its coefficients as numpy arrays.
        x0: displacement at release [m].
        motion: its turning points and its stop.
        parameters: the coefficients and then the nuisances, in order.
        residual: residual of a fit at the start values, with measured displacements of zero.
    """

    oscillator: Oscillator
    x0: float
    motion: PlannedMotion
    parameters: tuple[Parameter, ...]
    residual: Residual

    @property
    def ts(self) -> np.ndarray:
        """Sample times [s]."""
        return np.asarray(self.residual.runs[0].t)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def scales(self) -> np.ndarray:
        """Unit of each coordinate: the size of the value, shape (p,)."""
        return np.array([parameter.scale for parameter in self.parameters])


def planned_motion(oscillator: Oscillator, x0: float) -> PlannedMotion:
    """Return the motion after a release from `x0` [m].

    A law that is not set-valued is replaced by Coulomb's law.
    """
    law, load = oscillator.friction, oscillator.normal_force
    band, omega = float(oscillator.dead_band), float(oscillator.angular_frequency)
    if not (band > 0 and x0 != 0):
        return PlannedMotion(None, math.inf, np.array([x0]), not law.set_valued)
    twin = oscillator
    if not law.set_valued:
        mu = np.asarray(law.dynamic_force(load)) / np.asarray(load)
        twin = eqx.tree_at(lambda o: o.friction, oscillator, Coulomb(mu))
    # Without damping the motion is longest: each half-cycle loses two dead bands of amplitude.
    longest = math.pi / omega * (abs(x0) / (2 * band) + 4)
    motion: Motion = simulate(twin, x0, np.array([2 * longest]))
    stops = math.isfinite(float(motion.t_stop))
    points = np.asarray(motion.turning_points)
    return PlannedMotion(
        half_cycles=int(motion.n_half_cycles) if stops else None,
        t_stop=float(motion.t_stop),
        turning_points=points[np.isfinite(points)],
        like_coulomb=not law.set_valued,
    )


def planned_times(motion: PlannedMotion, rate: float, duration: float | None) -> np.ndarray:
    """Return sample times at a rate [1/s].

    Args:
        motion: the planned motion.
        rate: samples per second.
        duration: length of the record [s]; None: until 50 ms after the stop.

    Raises:
        UsageError: the rate or duration is not a positive number, or the mass never stops.
    """
    check_sampling(rate, duration)
    if duration is None and not math.isfinite(motion.t_stop):
        raise UsageError("The mass never comes to rest here: say with the duration how long to record.")
    length = motion.t_stop + TAIL if duration is None else float(duration)
    return np.arange(max(round(length * rate), 2)) / rate


def checked_times(ts: ArrayLike) -> np.ndarray:
    """Convert sample times to an array.

    Raises:
        UsageError: this is not a list of increasing times.
    """
    times = np.asarray(ts, float)
    if times.ndim != 1 or times.size < 2 or not np.all(np.diff(times) > 0):
        raise UsageError(f"ts must be a list of increasing times [s], at least two, got shape {times.shape}.")
    return times


def plan(
    oscillator: Oscillator,
    x0: float,
    ts: np.ndarray,
    names: Sequence[str] | None,
    nuisance: Sequence[str],
    *,
    noise: float = 1.0,
    engine: str | AbstractEngine = "auto",
    motion: PlannedMotion | None = None,
) -> Plan:
    """Plan a run.

    Args:
        oscillator: the machine at the expected values.
        x0: displacement at release [m]; the mass starts from rest at time zero.
        ts: sample times [s], increasing, shape (samples,).
        names: coefficients; None: all coefficients of the model.
        nuisance: free parameters of the run.
        noise: standard deviation of a sample [m].
        engine: see :func:`fricjax.simulate`.
        motion: the planned motion; None: it is computed here.

    Raises:
        UsageError: a name does not exist or appears twice, or the engine cannot integrate this oscillator.
    """
    ready()
    x0, nuisance = float(x0), tuple(nuisance)
    oscillator = jax.tree.map(lambda leaf: np.asarray(leaf, float), oscillator)
    leaves, values = leaves_of(oscillator), jax.tree.leaves(oscillator)
    if names is None:
        # A coefficient of zero is a missing term, except damping, which may be unknown before the run.
        shared = [leaf for leaf in leaves if leaf.name == "damping" or float(values[leaf.index]) != 0]
    else:
        shared = [find_leaf(name, leaves) for name in names]
    for name in nuisance:
        check_nuisance(name)
    check_once([*(leaf.name for leaf in shared), *nuisance])
    if not shared and not nuisance:
        raise UsageError("No parameter is named: name at least one coefficient or nuisance parameter.")
    # The planned run starts from rest after a slow pull, at time zero.
    run_values = {**dict.fromkeys(NUISANCES, 0.0), "x0": x0, "z0": 1.0}
    sizes = {name: abs(x0) or 1.0 if unit == "m" else 1.0 for name, unit in NUISANCES.items()}
    machine = [(leaf.name, leaf.unit, float(values[leaf.index])) for leaf in shared]
    parameters = (
        *(Parameter(name, unit, value, abs(value) if value else 1.0) for name, unit, value in machine),
        *(Parameter(name, NUISANCES[name], run_values[name], sizes[name]) for name in nuisance),
    )
    motion = planned_motion(oscillator, x0) if motion is None else motion
    count = NEVER if motion.half_cycles is None else motion.half_cycles
    run = Run(
        t=ts,
        x=np.zeros(ts.shape),
        weight=np.broadcast_to(1 / np.asarray(noise, float), ts.shape),
        half_cycles=np.asarray(count) if oscillator.friction.set_valued else None,
        fixed={name: np.asarray(value) for name, value in run_values.items()},
    )
    zeros = np.zeros(len(parameters))
    residual = Residual(
        oscillator=oscillator,
        space=ParameterSpace.build(parameters, [leaf.index for leaf in shared], (), (nuisance,)),
        engine=_engine(engine, oscillator, [leaf.kind for leaf in shared], motion, float(ts[-1]), x0),
        runs=(run,),
        prior_mean=zeros,
        prior_weight=zeros,
        inputs=np.zeros((0, len(leaves))),
    )
    return Plan(oscillator, x0, motion, parameters, with_mesh(residual, zeros))


def _engine(
    engine: str | AbstractEngine, oscillator: Oscillator, kinds: list[str], motion: PlannedMotion, end: float, x0: float
) -> AbstractEngine:
    """Return an engine with sufficient capacity for the half-cycles of the record."""
    capacity = half_cycle_capacity(oscillator, end, x0, 0.0)
    if motion.half_cycles is not None and not motion.like_coulomb:
        capacity = max(_CAPACITY, 2 ** math.ceil(math.log2(motion.half_cycles + 2)))
    # For zero drag "auto" chooses the closed form, which has no derivative with respect to the drag.
    named = "hybrid" if engine == "auto" and "drag" in kinds and oscillator.friction.set_valued else engine
    try:
        return select_engine(named, oscillator, max_half_cycles=capacity)
    except ValueError as error:
        raise UsageError(str(error)) from error
