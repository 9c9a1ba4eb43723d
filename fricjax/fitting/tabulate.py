"""Fits by tables of forces, on the host.

The forces of a law without internal states are tables, so a fit compiles nothing. NumPy evaluates the model, and the
solver runs on NumPy arrays as well.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Int

from ..data.observation import Observation
from ..estimation.loss import AbstractLoss, Squares
from ..estimation.passes import Pass, gather
from ..oscillator import Motion, Oscillator, Start
from ..oscillator.engines import AbstractEngine, AbstractPath, Demands
from ..oscillator.oscillator import leaves_of
from ..tables import Decay, Forces, Mesh, Tabulation, choose_layout, decay, make_mesh, reversals
from ..tables import Start as Release
from .derived import Derived, derive_on_host
from .evaluation import CHUNK, Block, Evaluation, block_columns, block_length
from .residual import ERRORS, Residual, Run, errors_of_reading
from .window import NEVER, Window, equilibrium

# Range of the tables relative to the fastest and the farthest motion of the record. A trial of the solver may exceed
# it; the polynomials of the last cells then extrapolate.
_RANGE = 4.0
# Half-cycles of a run that ends in motion, relative to those of its half-period, and in addition. The start value of
# the frequency is off by less than two per cent.
_MORE, _ADDED = 1.02, 1
# Largest number of iterations. From the turning points of a record, which are off by some per cent, five are enough.
_ITERATIONS = 8
# Samples that are processed at once; their derivatives take 64 bytes for each coordinate.
_PIECE = 1 << 17


class Tables(AbstractEngine):
    """Engine of fits: tables of the forces of the machine.

    Attributes:
        other: engine for motions that the tables do not resolve, and for single motions.
        checks: True for the mesh that checks another one; its points lie elsewhere.
        turning_points: approximate turning points of the record of a run, from its start [m]; None for the engine of
            several runs.
        half_period: typical duration of a half-cycle of that run [s].
    """

    name: ClassVar[str] = "tables"
    needs_mesh: ClassVar[bool] = False
    other: AbstractEngine
    checks: bool = eqx.field(static=True, default=False)
    turning_points: Any = None
    half_period: Any = None

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        law = oscillator.friction
        return f"{type(law).__name__} has internal states, and tables of forces have none." if law.n_states else None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Tables":
        return dataclasses.replace(self, other=self.other.tuned(oscillator, demands))

    def finer(self) -> AbstractEngine:
        return self.other.finer()

    def checking(self) -> "Tables":
        return dataclasses.replace(self, checks=True)

    def of_run(self, window: Window) -> "Tables":
        """Return the engine with the turning points of a record."""
        segmentation = window.segmentation
        later = segmentation.turning_times > window.t_start + segmentation.half_period / 4
        points = [window.guesses["x0"], *(segmentation.turning_points[later] - equilibrium(segmentation))]
        if segmentation.rest_position is not None:
            points.append(segmentation.rest_position - equilibrium(segmentation))
        return dataclasses.replace(self, turning_points=np.array(points), half_period=segmentation.half_period)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        return self.other.path(oscillator, start, half_cycles)

    def solve(self, oscillator: Oscillator, start: Start, ts: Any, half_cycles: Any = None) -> Motion:
        return self.other.solve(oscillator, start, ts, half_cycles)


def untabulated(residual: Residual) -> Residual:
    """Return the residual with the engine that computes single motions."""
    engine = residual.engine
    if not isinstance(engine, Tables):
        return residual
    return residual._replace(engine=engine.other).with_runs(engine=[None for _ in residual.runs])


class TabulatedModel:
    """Model of a residual by tables, evaluated on the host.

    The half-cycles, their points and the range of the tables belong to the coordinates `y` and stay fixed.
    """

    def __init__(self, residual: Residual, y: Any) -> None:
        self._residual, space = residual, residual.space
        engine: Any = residual.engine
        self._checks = engine.checks
        self._places = [space.places(number) for number in range(len(residual.runs))]
        shared = [*space.leaves, *(tie.leaf for tie in space.ties)]
        inputs = np.array(residual.inputs[:, : len(jax.tree.leaves(residual.oscillator))])
        # The values of the parameters replace these coefficients, so an input does not move them.
        inputs[:, shared] = 0.0
        leaves = list(dict.fromkeys([*shared, *np.flatnonzero(np.any(inputs != 0, axis=0)).tolist()]))
        self._leaves = leaves
        # Columns of the tables: the leaves, and the initial displacement.
        to_leaf = np.zeros((len(leaves) + 1, residual.n_parameters))
        for place, leaf in enumerate(space.leaves):
            to_leaf[leaves.index(leaf), place] += 1.0
        for tie in space.ties:
            to_leaf[leaves.index(tie.leaf), tie.parameter] += tie.factor
        self._to_leaf, self._by_input = to_leaf, np.pad(inputs[:, leaves], ((0, 0), (0, 1)))
        values = space.values(y[: residual.n_parameters])
        machine = space.model(residual.oscillator, values)
        flat = jax.tree.leaves(machine)
        self._fixed, self._is_free = np.array([float(flat[leaf]) for leaf in leaves]), np.any(to_leaf[:-1] != 0, axis=1)
        names = {leaf.index: leaf.dotted for leaf in leaves_of(residual.oscillator)}
        self._tabulation = Tabulation(machine, [names[leaf] for leaf in leaves], *self._reach(machine))
        self._latest: tuple[bytes, Any] = b"", None
        forces, layout, self._meshes = self._tables(values), None, list[Mesh]()
        # Half-cycles behind the stop of the law are left out, and no run has reached that stop.
        self._shortened, self._stuck = False, False
        for number, run in enumerate(residual.runs):
            x0 = float(self._parameters(values, number, run)["x0"])
            points = _turning_points(run, x0)
            layout = layout or choose_layout(machine, forces, points)
            meshed = functools.partial(make_mesh, machine, forces, layout=layout, check=self._checks)
            mesh = meshed(points)
            if int(run.half_cycles) >= NEVER or machine.friction.kink_speeds:
                first = reversals(forces, mesh, x0, _ITERATIONS)
                # A law that stops before the end of a record in motion rests there.
                stuck = np.flatnonzero(~(first.excess[1:-1] > 0))
                points = points[: int(stuck[0]) + 2] if stuck.size else points
                self._shortened |= bool(stuck.size)
                if machine.friction.kink_speeds:
                    # Panels meet at the kinks of the motion, which the turning points give only roughly.
                    known = mesh._replace(amplitudes=first.amplitudes[: points.size - 1])
                    mesh = meshed(points, previous=known)
                elif stuck.size:
                    mesh = meshed(points)
                else:
                    mesh = mesh._replace(amplitudes=first.amplitudes)
            self._meshes.append(mesh)

    @property
    def reaches_end(self) -> bool:
        """True if the law allows all half-cycles to the end."""
        return not (self._shortened or self._stuck)

    @property
    def half_cycles(self) -> list[int]:
        """Number of half-cycles of each run."""
        return [mesh.side.size for mesh in self._meshes]

    def evaluate(self, y: Any, weights: Sequence[Any], loss: AbstractLoss) -> Evaluation:
        """Return residual, gradient and normal matrix at coordinates `y`, from all samples.

        Args:
            y: coordinates, shape (coordinates,).
            weights: weights of the samples of each run, shape (samples,).
            loss: loss of the residuals.
        """
        residual, total, self._stuck = self._residual, y.size, False
        space = residual.space
        values, slope = (of(y[: residual.n_parameters]) for of in (space.values, space.slope))
        forces = self._tables(values)
        parts = [
            self._run(forces, values, slope, number, run, weight, loss, total)
            for number, (run, weight) in enumerate(zip(residual.runs, weights, strict=True))
        ]
        priors = (values - residual.prior_mean) * residual.prior_weight
        by_prior: Any = np.pad(np.diag(slope * residual.prior_weight), ((0, 0), (0, total - slope.size)))
        residuals, passes, points, blocks = zip(*parts, strict=True)
        sums = jax.tree.map(lambda *each: sum(each), gather(priors, by_prior, Squares()), *passes)
        joined = np.concatenate([*residuals, priors])
        return Evaluation(
            joined, joined @ joined, sums.cost, sums.gradient, sums.normal, list(passes), list(points), list(blocks)
        )

    def derive(self, y: Any) -> Derived:
        """Return the physical values for coordinates `y`, without compilation."""
        return derive_on_host(self._residual, y)

    def nothing(self, *_: Any) -> Evaluation:
        """Return the form of no evaluation."""
        return Evaluation(*[np.nan] * len(Evaluation._fields))

    def _tables(self, values: Any) -> Forces:
        """Return the tables at values of the parameters."""
        key = values.tobytes()
        if self._latest[0] != key:
            shared = np.where(self._is_free, self._to_leaf[:-1] @ values, self._fixed)
            self._latest = key, self._tabulation(shared)
        return self._latest[1]

    def _reach(self, machine: Oscillator) -> tuple[float, float]:
        """Return the largest speed [m/s] and displacement [m] of the tables."""
        engines: list[Any] = [run.engine for run in self._residual.runs]
        travel = _RANGE * max(float(np.max(np.abs(engine.turning_points))) for engine in engines)
        speed = travel * np.pi / min(engine.half_period for engine in engines)
        return speed, min(travel, float(machine.restoring.largest))

    def _parameters(self, values: Any, number: int, run: Run) -> dict[str, Any]:
        """Return state and offset of a run by name, free or fixed."""
        return {**run.fixed, **{name: values[place] for name, place in self._places[number].items()}}

    def _release(self, x0: Any) -> Release:
        columns = np.zeros(self._tabulation.columns)
        columns[len(self._leaves)] = 1.0
        return Release(x0, columns)

    def _run(
        self,
        forces: Forces,
        values: Any,
        slope: Any,
        number: int,
        run: Run,
        weight: Any,
        loss: AbstractLoss,
        total: int,
    ) -> tuple[np.ndarray, Pass, np.ndarray, np.ndarray]:
        """Return residual, sums, turning points and blocks of one run."""
        n = run.t.shape[0]
        size, length = -(-n // CHUNK) * CHUNK, block_length(n)
        used = int(np.max(np.flatnonzero(weight > 0), initial=-1)) + 1
        end = -(-used // CHUNK) * CHUNK
        at, places = self._parameters(values, number, run), self._places[number]
        release = self._release(at["x0"])
        r, blocks = np.zeros(size), np.zeros((size // length, len(Block._fields) - 1 + total), np.float32)
        none: Any = np.zeros(total)
        sums = Pass(np.zeros(()), none, np.outer(none, none))  # pyright: ignore[reportArgumentType]
        points = np.zeros(0)
        for begin in range(0, end, _PIECE):
            stop = min(begin + _PIECE, end)
            t, x, w = (
                np.concatenate([each[begin:stop], np.full(max(stop - n, 0), fill)])
                for each, fill in ((run.t, run.t[-1]), (run.x, run.x[-1]), (weight, 0.0))
            )
            times, observation = t - at["t_release"], run.observation
            motion = decay(forces, self._meshes[number], release, times, True, _ITERATIONS, order=observation.order)
            self._meshes[number] = self._meshes[number]._replace(amplitudes=motion.amplitudes)
            good = 1.0 if motion.resolved else np.nan
            self._stuck |= int(run.half_cycles) >= NEVER and not np.all(motion.excess[1:-1] > 0)
            reading = good * observation.read(motion.derivative[0]) + at["offset"] + at["drift"] * t
            columns = self._columns(motion, observation, reading, at, t, slope, places, total)
            left, slopes = w * (reading - x), w[:, None] * columns
            r[begin:stop] = left
            of_piece, sums_of_piece = _summed(left, slopes, x, w, loss, length)
            blocks[begin // length : stop // length] = of_piece
            sums = jax.tree.map(np.add, sums, sums_of_piece)
            points = motion.turning_points
        return r[:n], sums, points, blocks

    def _columns(
        self,
        motion: Decay,
        observation: Observation,
        reading: np.ndarray,
        at: dict[str, Any],
        t: np.ndarray,
        slope: np.ndarray,
        places: dict[str, int],
        total: int,
    ) -> np.ndarray:
        """Return the derivatives of the reading by all coordinates, shape (samples, coordinates)."""
        p, count = slope.size, len(self._leaves) + 1
        value, by_column, rate = motion.derivative
        by_column = by_column[:, :count]
        if not observation.linear:
            steep = observation.slope(value)
            by_column, rate = steep[:, None] * by_column, steep * rate
        by_value = by_column @ self._to_leaf
        direct = {
            "x0": lambda: by_column[:, count - 1],
            "t_release": lambda: -rate,
            "offset": lambda: np.ones(t.size),
            "drift": lambda: t,
        }
        for name, place in places.items():
            if name in direct:
                by_value[:, place] += direct[name]()
        columns = np.zeros((t.size, total))
        columns[:, :p] = by_value * slope
        if total > p:
            columns[:, p:] = by_column @ self._by_input.T
            if self._residual.period is not None:
                errors = errors_of_reading(observation, reading, rate + at["drift"], t, self._residual.period, np)
                columns[:, p:] += errors.T @ self._residual.inputs[:, -len(ERRORS) :].T
        return columns


def _turning_points(run: Run, x0: float) -> np.ndarray:
    """Return the turning points of a run.

    Those beyond the record continue its decay.
    """
    engine: Any = run.engine
    known, stops = np.asarray(engine.turning_points), int(run.half_cycles) < NEVER
    count = 1 + int(run.half_cycles)
    if not stops:
        count = 1 + int(np.ceil(_MORE * float(np.max(run.t)) / float(engine.half_period))) + _ADDED
    swings = np.abs(known)
    while swings.size < count:
        ratio = swings[-1] / swings[-2] if swings.size > 1 and 0 < swings[-1] < swings[-2] else 0.9
        swings = np.append(swings, max(ratio, 0.5) * swings[-1])
    points = np.sign(x0) * (-1.0) ** np.arange(count) * swings[:count]
    points[0] = x0
    # The mass may stop before it reaches the equilibrium.
    if stops and known.size == count:
        points[-1] = known[-1]
    return points


def _summed(
    left: Any, slopes: Any, seen: np.ndarray, weight: np.ndarray, loss: AbstractLoss, length: int
) -> tuple[np.ndarray, Pass]:
    """Return the sums of samples over blocks, and over all of them."""
    chunks = lambda each: each.reshape(-1, CHUNK)
    fields = block_columns(chunks(left), chunks(seen), chunks(weight), loss)
    few = np.stack([each.ravel() for each in fields], axis=1)
    curved = few[:, Block._fields.index("curvature")]
    blocks = np.concatenate([few, curved[:, None] * slopes], axis=1).reshape(-1, length, few.shape[1] + slopes.shape[1])
    return blocks.sum(axis=1).astype(np.float32), gather(left, slopes, loss)
