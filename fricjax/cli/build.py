"""The oscillator that a choice describes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..friction.catalogue import Law
from ..rig.quantity import UNITS

if TYPE_CHECKING:
    from ..oscillator import Oscillator
    from ..rig import Rig


def built(
    rig: "Rig", laws: Sequence[Law], given: Sequence[Mapping[str, float]], values: Mapping[str, float], engine: str
) -> "Oscillator":
    """The rig's oscillator with its law.

    Args:
        rig: the machine; coefficients that it holds itself are taken from there.
        laws: the law, or the summands of it.
        given: for each of them its coefficients.
        values: all coefficients by short or dotted name.
        engine: name of the engine that is to integrate it.

    Raises:
        UsageError: a coefficient outside of its bounds, or an engine that cannot integrate this oscillator.
    """
    import jax
    import numpy as np

    from .. import friction
    from ..fitting.names import find_leaf
    from ..friction import Sum
    from ..oscillator.leaves import leaves_of
    from ..oscillator.select import select_engine

    try:
        made = [getattr(friction, law.name)(**own) for law, own in zip(laws, given, strict=True)]
        oscillator = rig.oscillator(made[0] if len(made) == 1 else Sum(tuple(made)))
        leaves, found = jax.tree.leaves(oscillator), leaves_of(oscillator)
        for name, value in values.items():
            if name not in UNITS:
                leaves[find_leaf(name, found).index] = np.asarray(value, dtype=np.float64)
        oscillator = jax.tree.unflatten(jax.tree.structure(oscillator), leaves)
        select_engine(engine, oscillator)
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(str(error)) from error
    return oscillator
