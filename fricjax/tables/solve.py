"""Compiled decays, their padding, and the checks before a result is used."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .decay import Decay, decay
from .forces import Forces, Values
from .mesh import Mesh
from .nodes import Start

# Sizes of arrays that are compiled. Each is at most four times the needed one, so a decay does at most four times the
# work, and all records of up to 256 half-cycles and a million samples share 3 x 6 programs for each layout.
_HALF_CYCLES = (16, 64, 256)
_SAMPLES = tuple(1024 * 4**i for i in range(6))


def solve(forces: Forces, mesh: Mesh, start: Start, ts: Values, rests: Any = True, iterations: Any = 6) -> Decay:
    """Integrate a decay by a compiled program of JAX.

    Arguments and results are those of :func:`fricjax.tables.decay`. All machines share a program: it depends on the
    numbers of half-cycles, points, samples and columns only. Use :func:`fricjax.tables.padded` for few such numbers.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import make_mesh, padded, tabulate
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.01))
        >>> forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        >>> size = padded(half_cycles=2, samples=1)
        >>> mesh = make_mesh(machine, forces, [1e-3, -0.8e-3, 0.6e-3], half_cycles=size.half_cycles)
        >>> motion = solve(forces, mesh, Start(1e-3, np.eye(8)[7]), size.fill([np.pi / 100]))
        >>> print(f"{float(motion.x[0]):.6f}")
        -0.000800
    """
    return _solve(forces, mesh, start, ts, rests, iterations)


@jax.jit
def _solve(forces: Forces, mesh: Mesh, start: Start, ts: Values, rests: Any, iterations: Any) -> Decay:
    return decay(forces, mesh, start, ts, rests, iterations, xp=jnp)


class Size(NamedTuple):
    """Numbers of half-cycles and samples of a compiled program.

    Examples:
        >>> Size(16, 1024).fill([0.1, 0.2])[-1]
        np.float64(0.2)
    """

    half_cycles: int
    samples: int

    def fill(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """Repeat the last value up to the number of samples."""
        values = np.asarray(values, dtype=float)
        return np.concatenate([values, np.full(self.samples - values.size, values[-1])])


def padded(*, half_cycles: int, samples: int) -> Size:
    """Return the smallest compiled size for these numbers.

    Larger numbers than the largest size stay as they are, and compile a program.

    Examples:
        >>> padded(half_cycles=12, samples=10_000)
        Size(half_cycles=16, samples=16384)
    """
    pairs = ((half_cycles, _HALF_CYCLES), (samples, _SAMPLES))
    return Size(*(next((size for size in sizes if size >= number), number) for number, sizes in pairs))


class Error(NamedTuple):
    """Difference of a decay from that on another mesh.

    Attributes:
        x: largest difference of the displacement [m], shape ().
        columns: largest difference of a column relative to its largest value [1], shape ().

    Examples:
        >>> Error(1e-13, 1e-9).x
        1e-13
    """

    x: Any
    columns: Any


def error(motion: Decay, other: Decay, xp: Any = np) -> Error:
    """Estimate the error of a decay by that on a second mesh.

    The other mesh is that of `make_mesh(..., check=True)`. Its points lie elsewhere and its error is of the same size
    but independent. NaN, as after a decay that does not rest, gives NaN.

    Args:
        motion: the decay.
        other: the same decay on the other mesh, at the same samples.
        xp: `numpy` or `jax.numpy`.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import decay, make_mesh, tabulate
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Tanh(0.01, 1e-4))
        >>> forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        >>> meshes = [make_mesh(machine, forces, [1e-3, -0.8e-3, 0.6e-3], check=check) for check in (False, True)]
        >>> start, ts = Start(1e-3, np.eye(8)[7]), np.linspace(0.0, 0.06, 50)
        >>> difference = error(*(decay(forces, mesh, start, ts) for mesh in meshes))
        >>> bool(difference.x < 1e-14), bool(difference.columns < 1e-9)
        (True, True)
    """
    size = xp.max(xp.abs(motion.columns), axis=0)
    change = xp.max(xp.abs(motion.columns - other.columns), axis=0)
    # A column of zeros belongs to no coefficient.
    relative = xp.where(size == 0, change, change / xp.where(size == 0, 1.0, size))
    return Error(xp.max(xp.abs(motion.x - other.x)), xp.max(relative))
