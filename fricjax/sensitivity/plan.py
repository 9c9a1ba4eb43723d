"""A run that has not been made yet: its machine, its samples, its half-cycles, and its residual as a fit would have it.

The derivatives of a planned run are those of the fit to come, so the residual, the engines and the frozen mesh of
:mod:`fricjax.fitting` are taken as they are. The number of half-cycles stays at its value: the motion is smooth on that
branch, and where a law stops the mass after another number the motion jumps to another one.
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
"""Time at rest that a record should hold behind the stop [s]."""

# Room for at least so many half-cycles, more than most runs have: the size is part of a program, and runs of one size
# share their compilation.
_CAPACITY = 512


@dataclasses.dataclass(frozen=True)
class PlannedMotion:
    """Where the planned motion reverses and stops.

    Attributes:
        half_cycles: their number until the stop; None where the mass does not stop by itself.
        t_stop: time of the stop [s], inf for none.
        turning_points: the start and the reversals in order, the last one the stop [m], shape (half_cycles + 1,).
        like_coulomb: whether all this is that of a Coulomb law with the same dynamic friction, since the law itself
            stops the mass only gradually.
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
        residual: what a fit would make small, at its start values; the measured displacements are zero.
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
        """What one unit of each coordinate is: the size of the value, shape (p,)."""
        return np.array([parameter.scale for parameter in self.parameters])


def planned_motion(oscillator: Oscillator, x0: float) -> PlannedMotion:
    """The turning points of a release from `x0` [m], those of Coulomb's law for a law that is not set-valued."""
    law, load = oscillator.friction, oscillator.normal_force
    band, omega = float(oscillator.dead_band), float(oscillator.angular_frequency)
    if not (band > 0 and x0 != 0):
        return PlannedMotion(None, math.inf, np.array([x0]), not law.set_valued)
    twin = oscillator
    if not law.set_valued:
        mu = np.asarray(law.dynamic_force(load)) / np.asarray(load)
        twin = eqx.tree_at(lambda o: o.friction, oscillator, Coulomb(mu))
    # Without damping it takes the longest: each half-cycle then loses two dead bands of amplitude.
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
    """Samples at `rate` [1/s] for a `duration` [s]; None: until 50 ms after the stop.

    Raises:
        UsageError: a rate or duration that is no positive number, or a mass that never stops.
    """
    check_sampling(rate, duration)
    if duration is None and not math.isfinite(motion.t_stop):
        raise UsageError("The mass does not come to rest by itself here: say with the duration how long to record.")
    length = motion.t_stop + TAIL if duration is None else float(duration)
    return np.arange(max(round(length * rate), 2)) / rate


def checked_times(ts: ArrayLike) -> np.ndarray:
    """Sample times as an array.

    Raises:
        UsageError: no list of increasing times.
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
    """The planned run.

    Args:
        oscillator: the machine at the values that are expected.
        x0: displacement at release [m]; the mass starts from rest at time zero.
        ts: sample times [s], increasing, shape (samples,).
        names: coefficients; None for all that the model has.
        nuisance: free parameters of the run.
        noise: standard deviation of a sample [m].
        engine: as in a simulation.
        motion: turning points, where they are known already.

    Raises:
        UsageError: names that do not exist or appear twice, or an engine that cannot integrate this oscillator.
    """
    ready()
    x0, nuisance = float(x0), tuple(nuisance)
    oscillator = jax.tree.map(lambda leaf: np.asarray(leaf, float), oscillator)
    leaves, values = leaves_of(oscillator), jax.tree.leaves(oscillator)
    if names is None:
        # A coefficient of zero is a term left out, but for damping: a rig may not know it before the run.
        shared = [leaf for leaf in leaves if leaf.name == "damping" or float(values[leaf.index]) != 0]
    else:
        shared = [find_leaf(name, leaves) for name in names]
    for name in nuisance:
        check_nuisance(name)
    check_once([*(leaf.name for leaf in shared), *nuisance])
    if not shared and not nuisance:
        raise UsageError("No parameter is named: name at least one coefficient or nuisance parameter.")
    # The run at its planned values: from rest after a slow pull, released at time zero.
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
    """The engine; with room for the half-cycles until the stop, or for as many as the record can hold."""
    capacity = half_cycle_capacity(oscillator, end, x0, 0.0)
    if motion.half_cycles is not None and not motion.like_coulomb:
        capacity = max(_CAPACITY, 2 ** math.ceil(math.log2(motion.half_cycles + 2)))
    # At a drag of zero the closed form is chosen, which has no derivative by the drag.
    named = "hybrid" if engine == "auto" and "drag" in kinds and oscillator.friction.set_valued else engine
    try:
        return select_engine(named, oscillator, max_half_cycles=capacity)
    except ValueError as error:
        raise UsageError(str(error)) from error
