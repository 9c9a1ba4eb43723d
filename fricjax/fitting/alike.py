"""One traced computation for things of the same shape, such as the runs of a campaign.

A computation that is written out for every run takes as many times longer to compile; as the body of a loop it is
compiled once.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp


def for_each(fn: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Arrays that `fn` makes of each item: one after the other in a loop where all items have the same shape."""
    if len(items) < 2 or len({_shape(item) for item in items}) > 1:
        return [fn(item) for item in items]
    made = jax.lax.map(fn, jax.tree.map(lambda *values: jnp.stack(values), *items))
    return [jax.tree.map(lambda values, i=i: values[i], made) for i in range(len(items))]


def _shape(item: Any) -> Any:
    leaves, structure = jax.tree.flatten(item)
    return structure, tuple((jnp.shape(leaf), jnp.result_type(leaf)) for leaf in leaves)
