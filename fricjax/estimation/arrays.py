"""Array expressions that run under `numpy` and under `jax.numpy`.

A function takes the namespace from its arguments. So the same lines serve compiled programs and the host, which
compiles nothing.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def namespace(*values: Any) -> Any:
    """Return `jax.numpy` for arrays of JAX, else `numpy`."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def while_loop[State](
    xp: Any, condition: Callable[[State], Any], step: Callable[[State], State], state: State
) -> State:
    """Repeat a step while a condition holds."""
    if xp is jnp:
        return jax.lax.while_loop(condition, step, state)
    while condition(state):
        state = step(state)
    return state


def select(xp: Any, chosen: Any, first: Any, second: Any) -> Any:
    """Return one of two equal trees, the first if `chosen`."""
    if xp is jnp:
        return jax.tree.map(lambda a, b: jnp.where(chosen, a, b), first, second)
    return first if chosen else second


def fori_loop[State](xp: Any, count: int, step: Callable[[Any, State], State], state: State) -> State:
    """Repeat a step for the numbers below `count`."""
    if xp is jnp:
        return jax.lax.fori_loop(0, count, step, state)
    for i in range(count):
        state = step(i, state)
    return state
