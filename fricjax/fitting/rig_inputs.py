"""What the uncertain inputs of a rig change in the machine."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.errors import UsageError
from ..oscillator import Oscillator
from ..oscillator.leaves import leaves_of


def rig_inputs(rig: Any, oscillator: Oscillator, free: set[int]) -> Float[np.ndarray, "inputs leaves"]:
    """Change of each leaf of the machine for one standard uncertainty of each uncertain input of the rig.

    Args:
        rig: the rig, or None for none.
        oscillator: the machine that is fitted.
        free: leaves that are fitted, and may differ from the rig's.

    Raises:
        UsageError: a rig that describes another machine.
    """
    changes = [np.zeros((0, len(jax.tree.leaves(oscillator))))]
    if rig is None:
        return changes[0]
    for name, measured in rig.inputs().items():

        def machine(b: Array, name: str = name) -> Oscillator:
            return rig.with_inputs({name: b}).oscillator(oscillator.friction)

        at, by = jnp.asarray(float(measured.value)), jnp.asarray(float(measured.std))
        made, change = jax.jvp(machine, (at,), (by,))
        if jax.tree.structure(change) != jax.tree.structure(oscillator):
            raise UsageError(
                "The rig describes another machine than the oscillator. Build it with rig.oscillator(friction)."
            )
        changes.append(np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(change)])[None])
        _check_same(name, made, oscillator, free)
    return np.concatenate(changes)


def _check_same(name: str, made: Oscillator, oscillator: Oscillator, free: set[int]) -> None:
    """Refuse a rig whose numbers are not those of the oscillator, where these are not fitted."""
    for leaf, ours, theirs in zip(leaves_of(oscillator), *map(jax.tree.leaves, (oscillator, made)), strict=True):
        if leaf.index not in free and not np.isclose(float(ours), float(theirs), rtol=1e-9, atol=0):
            raise UsageError(
                f"The rig gives {leaf.name} = {float(theirs):.9g}, but the oscillator has {float(ours):.9g}. Build it "
                "with rig.oscillator(friction)."
            )
