"""Gaussian elimination of small linear systems in elementwise operations, without a call into LAPACK.

A loop stays one compiled kernel only while its body calls no library; for a system of a handful of unknowns the call
would also cost more than the arithmetic. Inside a step of an integration each entry is a scalar of its own, and the
factors serve several right-hand sides.
"""

import jax
from jaxtyping import Array

Entries = list[Array]


def factorise(matrix: list[Entries]) -> list[Entries]:
    """Triangular factors of a small matrix without pivoting, the lower ones in place and the pivots inverted.

    Without pivoting the matrix should be positive definite or dominated by its diagonal.
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
def substitute(factors: list[Entries], b: Entries) -> Entries:
    """Solution of the system whose matrix :func:`factorise` took apart, for the right-hand side `b`."""
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


def once[T](values: T) -> T:
    """Keep the compiler from computing these again wherever they are used: ten times faster, a fifth to compile."""
    return jax.lax.optimization_barrier(values)
