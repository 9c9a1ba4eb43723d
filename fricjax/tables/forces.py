"""Forces of a memoryless machine as tables over speed and displacement.

The equation of motion of a machine without internal states is ``a = s D(u) - r(x)``. ``D`` is the resisting force per
mass at the speed ``u`` (friction, viscous damping, drag), ``r`` the restoring force per mass, and ``s`` the side of the
turning point at which the half-cycle began; the mass moves in the direction ``-s``. Internal friction of the spring
depends on the displacement and is a part of ``r`` that differs between the sides. A table has cells with a polynomial
each. Kinks of the force are edges of cells.
"""

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr  # pyright: ignore[reportPrivateImportUsage]
from jaxtyping import Array, Float

from ..errors import check_choice
from ..oscillator import Oscillator
from ..oscillator.oscillator import leaves_of
from ..oscillator.session import ready
from .interpreter import evaluate

# Degree of the polynomials. Cells of speed have a constant ratio of their edges except the first one, which starts at
# zero. With u_0 the edge of the first cell and six cells per e-fold, a cell at speed u has the half-width u/12, so a
# force with a singularity at zero speed, such as a power, has the error 24^-8 = 1e-11 of its variation in the cell.
_DEGREE = 7
_SPEED_CELLS = 128
# Edge of the first cell relative to the largest speed. ln(1e9) = 20.7 e-folds give six cells per e-fold. A half-cycle
# passes the first cell within 1e-9 rad, in which any finite force changes the motion by less than rounding error.
_SLOWEST = 1e-9
# A sine over pi/8 rad has the error (pi/16)^8/8!/128 = 4e-13.
_TRAVEL_CELLS = 16
_COLUMNS = 8

if TYPE_CHECKING:
    type Values = Any
else:
    Values = Float[Array | np.ndarray, "..."] | np.float64


class Curve(NamedTuple):
    """Piecewise polynomial for both sides, with derivatives by the coefficients.

    The cells of the side -1 precede those of the side +1. Each polynomial is in a local coordinate from -1 to 1.

    Attributes:
        edges: edges of the cells [m/s or m], shape (cells + 1,).
        centres: centres of the cells [m/s or m], shape (cells,).
        scales: local coordinate per speed or displacement [s/m or 1/m], shape (cells,).
        value: coefficients of the powers of the local coordinate [m/s^2], shape (powers, 2 cells).
        columns: the same for each derivative [m/s^2 per unit], shape (powers, columns, 2 cells).
    """

    edges: Values
    centres: Values
    scales: Values
    value: Values
    columns: Values


class Forces(NamedTuple):
    """Forces per mass of a machine at fixed coefficients.

    Attributes:
        resisting: force per mass against the speed [m/s^2].
        restoring: force per mass against the displacement [m/s^2]; internal friction of the spring is subtracted on the
            side +1 and added on the side -1.
        onset: friction force per mass as sliding begins, without regularisation [m/s^2], shape ().
        static: largest force per mass that holds the mass at a reversal [m/s^2], shape (); zero for a regularised law.
        breakaway: the same before the release [m/s^2], shape ().
        velocity_scale: speed range near rest in which friction changes fast [m/s], shape (); inf without one.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.05, 10.0, fj.friction.Coulomb(0.01))
        >>> forces = tabulate(machine, ["mu", "stiffness"], speed=0.2, travel=2e-3)
        >>> forces.resisting.columns.shape, round(float(forces.onset), 6)
        ((8, 8, 256), 1.0)
    """

    resisting: Curve
    restoring: Curve
    onset: Values
    static: Values
    breakaway: Values
    velocity_scale: Values


class Tabulation:
    """Tables of a machine for many values of some of its coefficients.

    It traces the machine once per process, friction law and choice of names (about 10 ms), and evaluates the jaxpr by
    NumPy (0.3 to 2 ms). It compiles nothing.

    Args:
        oscillator: the machine; its law must have no internal states.
        names: coefficients for the derivatives, by the names of :func:`fricjax.fit`.
        speed: largest speed of the tables [m/s].
        travel: largest displacement of the tables [m].
        columns: number of columns for derivatives; columns after those of the names are zero and free for others, such
            as the initial displacement. By default a multiple of eight with at least one free column.

    Raises:
        ValueError: the law has internal states, a coefficient does not exist, or there are too few columns.
        RuntimeError: JAX computes in single precision.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.05, 10.0, fj.friction.Tanh(0.01, 1e-4))
        >>> tabulation = Tabulation(machine, ["mu", "v_s"], speed=0.2, travel=2e-3)
        >>> [round(float(tabulation([mu, 1e-4]).onset), 6) for mu in (0.01, 0.02)]
        [1.0, 2.0]
    """

    def __init__(
        self, oscillator: Oscillator, names: Sequence[str], speed: float, travel: float, columns: int | None = None
    ) -> None:
        ready()
        law = oscillator.friction
        if law.n_states:
            raise ValueError(
                f"Tables hold forces of laws without internal states, and {type(law).__name__} has {law.n_states}. "
                'Use engine="smooth".'
            )
        self.names = tuple(names)
        self.columns = columns or _COLUMNS * (len(self.names) // _COLUMNS + 1)
        if self.columns < len(self.names):
            raise ValueError(f"{len(self.names)} coefficients need as many columns, got {self.columns}.")
        leaves, structure = jax.tree.flatten(oscillator)
        self._leaves = [np.float64(leaf) for leaf in leaves]
        self._free = _places(oscillator, self.names)
        kinks = [kink for kink in law.kink_speeds if 0 < kink < speed]
        self._speeds = _Grid(_speed_edges(speed, kinks))
        self._travels = _Grid(np.linspace(-travel, travel, _TRAVEL_CELLS + 1))
        self._program = _traced(structure, self._free, self._speeds.points.size, self._travels.points.size)

    @property
    def values(self) -> np.ndarray:
        """Values of the named coefficients in the machine, shape (names,)."""
        return np.array([self._leaves[place] for place in self._free])

    def __call__(self, values: Sequence[float] | np.ndarray) -> Forces:
        """Tabulate the forces at values of the named coefficients [SI]."""
        leaves = list(self._leaves)
        for place, value in zip(self._free, values, strict=True):
            leaves[place] = np.float64(value)
        # A law may divide by zero on a branch that it does not select.
        with np.errstate(all="ignore"):
            results = evaluate(self._program, *leaves, self._speeds.points, self._travels.points)
        (resisting, restoring, hysteresis, *levels), columns = results[:_LEVELS], results[_LEVELS:]
        by_speed, by_travel, by_side = (
            _stacked(part, columns[i::3], self.columns) for i, part in enumerate(results[:3])
        )
        return Forces(
            self._speeds.curve((resisting, resisting), (by_speed, by_speed)),
            self._travels.curve(
                (restoring + hysteresis, restoring - hysteresis), (by_travel + by_side, by_travel - by_side)
            ),
            *map(np.float64, levels),
        )


def tabulate(
    oscillator: Oscillator, names: Sequence[str], *, speed: float, travel: float, columns: int | None = None
) -> Forces:
    """Tabulate the forces of a machine and their derivatives.

    The arguments and errors are those of :class:`Tabulation`.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.05, 10.0, fj.friction.Stribeck(0.01, 0.013, 1e-3))
        >>> forces = tabulate(machine, ["mu", "mu_s"], speed=0.2, travel=2e-3)
        >>> round(float(forces.static), 6)
        1.3
    """
    tabulation = Tabulation(oscillator, names, speed, travel, columns)
    return tabulation(tabulation.values)


class _Grid:
    """Cells of a curve with the points of evaluation."""

    def __init__(self, edges: np.ndarray) -> None:
        places = -np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)
        self._powers = np.linalg.inv(np.vander(places, increasing=True))
        half = np.diff(edges) / 2
        self.edges, self.centres, self.scales = edges, edges[:-1] + half, 1 / half
        self.points = (self.centres[:, None] + half[:, None] * places).ravel()
        # Rounding must not put a point across an edge, where a law may have another branch.
        self.points = np.clip(self.points, np.repeat(edges[:-1], places.size), np.repeat(edges[1:], places.size))

    def curve(self, values: tuple[Any, Any], columns: tuple[Any, Any]) -> Curve:
        """Return the curve from values at the points.

        Both arguments hold the arrays of the sides -1 and +1.
        """
        parts = (self._coefficients(np.concatenate(each, axis=-1)) for each in (values, columns))
        return Curve(self.edges, self.centres, self.scales, *parts)

    def _coefficients(self, values: np.ndarray) -> np.ndarray:
        by_cell = values.reshape(*values.shape[:-1], -1, _DEGREE + 1)
        return np.ascontiguousarray(np.moveaxis(by_cell @ self._powers.T, -1, 0))


def _speed_edges(speed: float, kinks: Sequence[float]) -> np.ndarray:
    """Return edges in even steps of ln(1 + u/u_0), and the kinks."""
    lowest = _SLOWEST * speed
    even = lowest * np.expm1(np.linspace(0.0, np.log1p(1 / _SLOWEST), _SPEED_CELLS + 1 - len(kinks)))
    even[-1] = speed
    return np.sort(np.append(even, kinks))


def _places(oscillator: Oscillator, names: Sequence[str]) -> tuple[int, ...]:
    """Return the leaf index of each named coefficient."""
    leaves = leaves_of(oscillator)
    places = {name: leaf.index for leaf in leaves for name in (leaf.dotted, leaf.name)}
    for name in names:
        check_choice("coefficient", name, places)
    return tuple(places[name] for name in names)


def _stacked(like: np.ndarray, columns: Sequence[np.ndarray], count: int) -> np.ndarray:
    """Stack columns as rows, padded with zeros."""
    rows = np.zeros((count, like.size))
    for row, column in zip(rows, columns, strict=False):
        row[:] = column
    return rows


# Outputs of the traced function before the columns: three curves and four levels.
_LEVELS = 7


@functools.lru_cache(maxsize=64)
def _traced(structure: Any, free: tuple[int, ...], speeds: int, travels: int) -> ClosedJaxpr:
    """Trace forces per mass and their derivatives by the leaves `free`."""

    def forces(leaves: Sequence[Any], speed: Any, travel: Any) -> tuple[Any, ...]:
        machine = jax.tree.unflatten(structure, leaves)
        law, load, mass = machine.friction, machine.normal_force, machine.mass
        resisting = machine.dissipation(speed) + law.sliding_force(speed, load)
        curves = (resisting, machine.restoring_force(travel), machine.hysteresis(travel))
        onset = law.set_valued_limit().sliding_force(jnp.zeros(()), load)
        levels = (onset, law.static_force(load), law.breakaway_force(load))
        shapes = (speed.shape, travel.shape, travel.shape, (), (), ())
        sized = (jnp.broadcast_to(each, shape) for each, shape in zip((*curves, *levels), shapes, strict=True))
        return *(each / mass for each in sized), jnp.asarray(law.velocity_scale())

    def with_columns(leaves: Sequence[Any], speed: Any, travel: Any) -> tuple[Any, ...]:
        columns = []
        for place in free:

            def by_one(value: Any, place: int = place) -> tuple[Any, ...]:
                return forces([*leaves[:place], value, *leaves[place + 1 :]], speed, travel)[:3]

            columns += jax.jvp(by_one, (leaves[place],), (jnp.ones(()),))[1]
        return *forces(leaves, speed, travel), *columns

    number = jax.ShapeDtypeStruct((), np.float64)
    arrays = (jax.ShapeDtypeStruct((size,), np.float64) for size in (speeds, travels))
    return jax.make_jaxpr(with_columns)([number] * structure.num_leaves, *arrays)
