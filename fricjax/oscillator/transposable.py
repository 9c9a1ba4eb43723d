"""Derivatives in both modes for functions with loops.

JAX cannot transpose a loop of unknown length. A motion, however, depends on about a dozen numbers, so its Jacobian is
cheap in forward mode. The derivative rule computes this Jacobian and multiplies it by the tangents. A product with a
matrix can be transposed, so reverse mode works too. The rule applies to the Jacobian as well, so derivatives of any
order exist.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import sequential_vmap
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float


class Outputs(NamedTuple):
    """Results of a transposable function.

    Attributes:
        sampled: arrays of floats. The last axis runs over the samples, and each entry depends on its own time only.
        single: arrays of floats that do not depend on the times of the samples.
        discrete: pytree of counts, flags and statistics; their derivatives are zero.
    """

    sampled: tuple[Array, ...]
    single: tuple[Array, ...]
    discrete: Any = ()


def transposable[Numbers](
    function: Callable[[Numbers, Float[Array, " samples"]], Outputs],
) -> Callable[[Numbers, Float[Array, " samples"]], Outputs]:
    """Give a function derivatives of any order in forward and reverse mode.

    On a CPU `jax.vmap` computes the calls one after the other. This takes less time than a batch for every engine
    (experiments/benchmarks/gradients.py), most of all if the loops have different lengths.

    Args:
        function: function of a pytree of numbers and of the times of the samples.

    Examples:
        >>> def root(numbers, ts):
        ...     step = lambda x: (x + numbers / x) / 2
        ...     x = jax.lax.while_loop(lambda x: jnp.abs(x**2 - numbers) > 1e-12, step, numbers)
        ...     return Outputs(sampled=(), single=(x,))
        >>> square_root = transposable(root)
        >>> value, slope = jax.value_and_grad(lambda a: square_root(a, jnp.zeros(0)).single[0])(4.0)
        >>> print(f"{value:.6f} {slope:.6f}")
        2.000000 0.250000
    """
    mapped = sequential_vmap(function) if jax.default_backend() == "cpu" else function

    @jax.custom_jvp
    def wrapped(numbers: Any, ts: Array) -> Outputs:
        return mapped(numbers, ts)

    @functools.partial(wrapped.defjvp, symbolic_zeros=True)
    def rule(primals: tuple, tangents: tuple) -> tuple[Outputs, Outputs]:
        (numbers, ts), (changes, shift) = primals, tangents
        changes = jax.tree.leaves(changes, is_leaf=_is_zero)
        active = tuple(i for i, change in enumerate(changes) if not _is_zero(change))
        moved = not _is_zero(shift)
        jacobian = transposable(_with_jacobian(function, active, moved))
        sampled, single, discrete = jacobian(numbers, ts)
        values = Outputs(sampled[::2], single[::2], discrete)
        change = jnp.concatenate([jnp.ravel(changes[i]) for i in active]) if active else jnp.zeros(0)

        def along(columns: Array) -> Array:
            return jnp.tensordot(change, columns[: change.size], axes=1)

        rates = tuple(along(each) + each[-1] * shift if moved else along(each) for each in sampled[1::2])
        still = jax.tree.map(lambda each: np.zeros(np.shape(each), _tangent_dtype(each)), discrete)
        return values, Outputs(rates, tuple(map(along, single[1::2])), still)

    return wrapped


def _tangent_dtype(value: Any) -> Any:
    dtype = jnp.result_type(value)
    return dtype if jnp.issubdtype(dtype, jnp.inexact) else jax.dtypes.float0


def _is_zero(tangent: Any) -> bool:
    return isinstance(tangent, SymbolicZero)


def _with_jacobian(function: Callable, active: tuple[int, ...], moved: bool) -> Callable:
    """Extend a function by its Jacobian.

    Each float result is followed by its derivatives along a new first axis: one entry for each element of the active
    numbers, then, if `moved`, one for a common shift of all times.
    """

    def extended(numbers: Any, ts: Array) -> Outputs:
        leaves, structure = jax.tree.flatten(numbers)
        place = [leaves[i] for i in active]
        ends = np.cumsum([0, *(jnp.size(each) for each in place)])
        unit = np.eye(ends[-1] + moved)
        directions = [
            unit[:, low:high].reshape(-1, *jnp.shape(each))
            for low, high, each in zip(ends, ends[1:], place, strict=False)
        ]
        if moved:
            place, directions = [*place, ts], [*directions, unit[:, -1:] * np.ones(jnp.size(ts))]

        def at(place: list[Array]) -> tuple:
            filled = list(leaves)
            for i, each in zip(active, place, strict=False):
                filled[i] = each
            outputs = function(jax.tree.unflatten(structure, filled), place[-1] if moved else ts)
            return (outputs.sampled, outputs.single), outputs.discrete

        def column(direction: Any) -> tuple:
            return jax.jvp(at, (place,), (direction,), has_aux=True)

        values, slopes, discrete = jax.vmap(column, out_axes=(None, 0, None))(directions)
        sampled, single = (
            tuple(each for pair in zip(*both, strict=True) for each in pair)
            for both in zip(values, slopes, strict=True)
        )
        return Outputs(sampled, single, discrete)

    return extended
