"""Shared tables: golden motions, rigs, friction laws, finite differences."""

import inspect
import re
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fricjax import friction
from fricjax.friction import AbstractFriction, Coulomb
from fricjax.oscillator import Oscillator
from tests.cases.bristle import BRISTLE
from tests.cases.memoryless import MEMORYLESS
from tests.cases.slip import SLIP

PROTOTYPE_MASS = 2574.0 / (2 * np.pi * 12.6) ** 2
PROTOTYPE_DAMPING = 2 * 0.0027 * np.sqrt(2574.0 * PROTOTYPE_MASS)

EXPORTED_LAWS: dict[str, Any] = {
    name: law
    for name in friction.__all__
    if inspect.isclass(law := getattr(friction, name)) and issubclass(law, AbstractFriction)
    if not inspect.isabstract(law)
}
"""All concrete laws by name."""


class Golden(NamedTuple):
    """Run with a final position known to twelve digits."""

    name: str
    mass: float
    stiffness: float
    damping_ratio: float
    mu: float
    mu_s: float
    normal_force: float
    x0: float
    half_cycles: int
    final: float
    t_stop: float

    @property
    def damping(self) -> float:
        return 2 * self.damping_ratio * np.sqrt(self.stiffness * self.mass)

    def oscillator(self) -> Oscillator:
        return Oscillator(self.mass, self.stiffness, self.damping, self.normal_force, Coulomb(self.mu, self.mu_s))


_M = PROTOTYPE_MASS
GOLDEN = (
    Golden("fig 2", 1, 5000, 0, 0.1, 0.1, 9.81, 3e-3, 8, -1.392000000000e-04, 0.355430635053),
    Golden("fig 3", 1, 5000, 0, 0.1, 0.1, 9.81, 1e-3, 3, 1.772000000000e-04, 0.133286488145),
    Golden("fig 9, 1 %", 1, 5000, 0.01, 0.1, 0.1, 9.81, 3e-3, 7, 5.819442413526e-05, 0.311017356928),
    Golden("fig 9, 10 %", 1, 5000, 0.1, 0.1, 0.1, 9.81, 3e-3, 4, -5.026229793856e-05, 0.178610614465),
    Golden("standard gravity", 1, 5000, 0, 0.1, 0.1, 9.80665, 3e-3, 8, -1.381280000000e-04, 0.355430635053),
    Golden("static 3 mm", 1, 5000, 0, 0.1, 0.13, 9.81, 3e-3, 7, -2.532000000000e-04, 0.311001805671),
    Golden("static 1 mm", 1, 5000, 0, 0.1, 0.13, 9.81, 1e-3, 2, 2.152000000000e-04, 0.088857658763),
    Golden("static, 1 %", 1, 5000, 0.01, 0.1, 0.13, 9.81, 3e-3, 7, 5.819442413526e-05, 0.311017356928),
    Golden("prototype", _M, 2574, 0.0027, 0.05, 0.05, 9.66, 1e-3, 3, 1.368024238719e-04, 0.119048052979),
    Golden("prototype static", _M, 2574, 0.0027, 0.05, 0.065, 9.66, 2e-3, 5, -7.971757356672e-05, 0.198413421631),
    Golden("rolling 0.001", _M, 2574, 0.0027, 0.001, 0.001, 1.89, 2e-3, 298, 3.726215355742e-07, 11.825439929204),
    Golden("rolling 0.005", _M, 2574, 0.0027, 0.005, 0.005, 1.89, 2e-3, 141, -9.213987975006e-07, 5.595258489992),
    Golden("negative start", 1, 5000, 0.05, 0.1, 0.12, 9.81, -2.5e-3, 4, -1.652899379657e-04, 0.177937879063),
)
FIG_2, FIG_9 = GOLDEN[0], GOLDEN[2]
SAMPLE_TIMES = np.array([0.01, 0.05, 0.1, 0.2, 0.3])
FIG_2_X = np.array(
    [2.327773801281e-03, -2.422895107641e-03, 1.620297422837e-03, 1.900676771959e-04, -1.239333154216e-04]
)
FIG_2_V = np.array(
    [-1.287961096015e-01, 6.544764539722e-02, -1.012004824660e-01, -8.727004167001e-02, -2.230190803016e-02]
)
FIG_9_X = np.array(
    [2.330904741596e-03, -2.343423584099e-03, 1.511664277357e-03, 2.017046552900e-04, 9.820268583460e-05]
)
FIG_2_TURNING_POINTS = 1e-3 * np.array([3, -2.6076, 2.2152, -1.8228, 1.4304, -1.038, 0.6456, -0.2532, -0.1392])


LAWS = MEMORYLESS | BRISTLE | SLIP


def central_differences(f: Callable[[jax.Array], jax.Array], p: jax.Array, step: float) -> tuple[jax.Array, jax.Array]:
    """Return derivatives of `f` by fourth-order and by second-order differences."""
    offsets = jnp.concatenate([s * step * jnp.eye(p.size) for s in (1.0, -1.0, 2.0, -2.0)])
    values = jnp.split(jax.lax.map(lambda d: f(p + d), offsets), 4)
    near, far = (values[0] - values[1]) / (2 * step), (values[2] - values[3]) / (4 * step)
    return (4 * near - far) / 3, near


def python_in(sentence: str) -> list[str]:
    """Find Python syntax in a sentence: keyword arguments, calls, lists, constants.

    Values of options such as ``--fix mu=...``, quotations and lines of a rig file do not count.
    """
    left = re.sub(r"--[a-z-]+ \S+|'[^']*'|\w+ = (?:\"[^\"]*\"|\S+)", "", sentence)
    return re.findall(r"\w+=|\w\(\)|\[['\"]|\b(?:True|False|None)\b", left)


@contextmanager
def largest(size: int) -> Iterator[None]:
    """Limit files of this process to `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
