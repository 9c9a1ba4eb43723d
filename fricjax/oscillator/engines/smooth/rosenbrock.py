"""Rosenbrock method of order five for small stiff systems, for diffrax.

Bristle laws are stiff in full sliding (the deflection settles within microseconds) and mild at the reversals. A
Rosenbrock method handles both by one linear solve per stage without iteration. This is Rodas5P (Steinebach, BIT Numer.
Math. 63, 2023): eight stages, stiffly accurate, an embedded error estimate of order four and a dense output of order
four.

The state is a pytree of two to four scalars. Forward mode gives its Jacobian. Scalar operations eliminate the linear
system, so that a whole integration is one compiled loop without calls into LAPACK.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..elementary import once

_GAMMA = 0.21193756319429014
_A = (
    (),
    (3.0,),
    (2.849394379747939, 0.45842242204463923),
    (-6.954028509809101, 2.489845061869568, -10.358996098473584),
    (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
    (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
)
_C = (
    (),
    (-14.155112264123755,),
    (-17.97296035885952, -2.859693295451294),
    (147.12150275711716, -1.41221402718213, 71.68940251302358),
    (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
    (
        30.91273214028599,
        -3.1208243349937974,
        77.79954646070892,
        34.28646028294783,
        -19.097331116725623,
        -28.087943162872662,
    ),
    (
        37.80277123390563,
        -3.2571969029072276,
        112.26918849496327,
        66.9347231244047,
        -40.06618937091002,
        -54.66780262877968,
        -9.48861652309627,
    ),
)
_NODES = (0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0)
_TIME = (0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069)
_DENSE = (
    (
        25.948786856663858,
        -2.5579724845846235,
        10.433815404888879,
        -2.3679251022685204,
        0.524948541321073,
        1.1241088310450404,
        0.4272876194431874,
        -0.17202221070155493,
    ),
    (
        -9.91568850695171,
        -0.9689944594115154,
        3.0438037242978453,
        -24.495224566215796,
        20.176138334709044,
        15.98066361424651,
        -6.789040303419874,
        -6.710236069923372,
    ),
    (
        11.419903575922262,
        2.8879645146136994,
        72.92137995996029,
        80.12511834622643,
        -52.072871366152654,
        -59.78993625266729,
        -0.15582684282751913,
        4.883087185713722,
    ),
)

Scalars = list[Array]


def factorise(matrix: list[Scalars]) -> list[Scalars]:
    """Factorise a small matrix without pivoting.

    The lower factors replace the matrix, with inverted pivots. The matrix should be positive definite or diagonally
    dominant.
    """
    a = [list(row) for row in matrix]
    n = len(a)
    for k in range(n):
        a[k][k] = 1 / a[k][k]
        for i in range(k + 1, n):
            a[i][k] = a[i][k] * a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - a[i][k] * a[k][j]
    return a


# Traced once for all right-hand sides.
@jax.jit
def substitute(factors: list[Scalars], b: Scalars) -> Scalars:
    """Solve the system factorised by :func:`factorise` for the right-hand side `b`."""
    n = len(b)
    y = list(b)
    for i in range(n):
        for j in range(i):
            y[i] = y[i] - factors[i][j] * y[j]
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            y[i] = y[i] - factors[i][j] * y[j]
        y[i] = y[i] * factors[i][i]
    return y


def _combine(weights: tuple[float | Array, ...], vectors: list[Scalars], n: int) -> Scalars:
    """Return the weighted sum of vectors of n scalars."""
    zero = jnp.zeros(())
    return [sum((w * k[i] for w, k in zip(weights, vectors, strict=False)), start=zero) for i in range(n)]


class _DenseOutput(diffrax.AbstractLocalInterpolation):
    """Continuous extension of the method, a quartic through both step ends."""

    t0: Any
    t1: Any
    y0: Any
    y1: Any
    k: Any

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        if t1 is not None:
            return jax.tree.map(jnp.subtract, self.evaluate(t1), self.evaluate(t0))
        width = self.t1 - self.t0
        u = (t0 - self.t0) / jnp.where(width == 0, 1.0, width)

        def blend(y0: Array, y1: Array, k: Array) -> Array:
            return y0 + u * (y1 - y0) + u * (1 - u) * (k[0] + u * (k[1] + u * k[2]))

        return jax.tree.map(blend, self.y0, self.y1, self.k)


class Rodas5P(diffrax.AbstractAdaptiveSolver):
    """Rosenbrock method of order 5(4) for a few scalars (Steinebach, 2023).

    Attributes:
        modes: number of trailing scalars without a rate; the linear system omits them.

    Examples:
        >>> decay = diffrax.ODETerm(lambda t, y, args: (-1e3 * y[0],))
        >>> solution = diffrax.diffeqsolve(decay, Rodas5P(), 0.0, 1.0, 0.01, (jnp.ones(()),))
        >>> bool(abs(solution.ys[0][-1]) < 1e-12)
        True
    """

    modes: int = eqx.field(default=0, static=True)

    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar[Callable[..., _DenseOutput]] = _DenseOutput

    def order(self, terms: Any) -> int:
        return 5

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> None:
        return None

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return terms.vf(t0, y0, args)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: None, made_jump: Any
    ) -> tuple[Any, Any, dict, None, diffrax.RESULTS]:
        return *_step(terms, t0, t1, y0, args, self.modes), None, diffrax.RESULTS.successful


@eqx.filter_jit
def _step(terms: Any, t0: Any, t1: Any, y0: Any, args: Any, modes: int) -> tuple[Any, Any, dict]:
    """Make one step without products with the Jacobian (Hairer and Wanner, IV.7)."""
    leaves, structure = jax.tree.flatten(y0)
    n, h = len(leaves) - modes, t1 - t0
    leaves, constant = leaves[:n], leaves[n:]

    def pytree(moving: list, rest: list) -> Any:
        return jax.tree.unflatten(structure, [*moving, *rest])

    # A separate jitted function is traced once for all stages.
    @jax.jit
    def field(t: Array, y: Scalars) -> Scalars:
        return jax.tree.leaves(terms.vf(t, pytree(y, constant), args))[:n]

    f0, partial_t, factors = _linearise(field, t0, leaves, h)
    stages: list[Scalars] = []
    y = leaves
    for i, couplings in enumerate(_C):
        if 0 < i < len(_A):
            y = [a + b for a, b in zip(leaves, _combine(_A[i], stages, n), strict=True)]
        elif i >= len(_A):
            y = [a + b for a, b in zip(y, stages[-1], strict=True)]
        rate = f0 if i == 0 else field(t0 + _NODES[i] * h, y)
        drift = [r + h * _TIME[i] * d for r, d in zip(rate, partial_t, strict=True)] if i < len(_TIME) else rate
        past = _combine(tuple(c / h for c in couplings), stages, n)
        right = [a + b for a, b in zip(drift, past, strict=True)]
        stages.append(once(substitute(factors, right)))
    y1 = pytree([a + b for a, b in zip(y, stages[-1], strict=True)], constant)
    dense = [jnp.stack([_combine(row, stages, n)[i] for row in _DENSE]) for i in range(n)]
    info = {"y0": y0, "y1": y1, "k": pytree(dense, modes * [jnp.zeros(len(_DENSE))])}
    return y1, pytree(stages[-1], modes * [jnp.zeros(())]), info


def _linearise(field: Callable, t: Any, y: Scalars, h: Array) -> tuple[Scalars, Scalars, list[Scalars]]:
    """Return rate, time derivative, and factors of ``1/(gamma h) - J``."""
    n = len(y)
    rate, derivative = jax.linearize(field, t, y)
    # All directions in parallel: first time, then the state.
    along = jnp.identity(n + 1)
    slopes = once(jax.vmap(lambda row: derivative(row[0], list(row[1:])))(along))
    matrix = [[(1 / (_GAMMA * h) if i == j else 0.0) - slopes[i][j + 1] for j in range(n)] for i in range(n)]
    return once((rate, [slope[0] for slope in slopes], factorise(matrix)))
