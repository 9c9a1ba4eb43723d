"""Which coefficient of a law does what: what the law's forces say, not the names that it gives to its coefficients.

A contact that yields is a spring while it is bent little: ``dF/dt = K v``, with a damping beside it. Coefficients
that change this stiffness K, or this damping, but not the force of steady sliding, belong to the contact; those that
change the dynamic force carry the friction.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..friction import AbstractFriction
from ..friction.coefficient import Coefficient

_SAME = 1e-9


class Force(NamedTuple):
    """A force law in numbers, each with its derivative by every coefficient, shape (coefficients,).

    Attributes:
        dynamic: dynamic force [N].
        constant: what is left of the force of steady sliding at the speed of the run without what is proportional to
            the speed [N]; the decay tells it apart from damping.
        sliding: force of steady sliding at the speed of the run [N].
        stiffness: contact stiffness [N/m]; NaN for a law whose states are no deflection.
        damping: contact damping at rest [N s/m].
    """

    dynamic: Any
    constant: Any
    sliding: Any
    stiffness: Any
    damping: Any


def force_of(law: AbstractFriction, load: float, speed: float) -> tuple[Force, Force]:
    """The forces of a law, and their derivatives by its leaves."""
    values, slopes = _force_of(law, np.float64(load), np.float64(speed))
    return Force(*map(float, values)), Force(*map(np.asarray, slopes))


@eqx.filter_jit
def _force_of(law: AbstractFriction, load: Any, speed: Any) -> tuple[Force, Force]:
    leaves, structure = jax.tree.flatten(law)

    def forces(values: Any) -> tuple[Force, Force]:
        found = _forces(jax.tree.unflatten(structure, list(values)), load, speed)
        return found, found

    slopes, values = jax.jacfwd(forces, has_aux=True)(jnp.stack([jnp.asarray(leaf, float) for leaf in leaves]))
    return values, slopes


def _forces(law: AbstractFriction, load: Any, speed: Any) -> Force:
    straight, still = jnp.zeros(law.n_states), jnp.zeros(())

    def gained(v: Any) -> Any:
        """Force gained per way from a straight contact."""
        rate = law.rate(jnp.asarray(v), straight, load) / v
        return jax.jvp(lambda state: law.force(still, state, load), (straight,), (rate,))[1]

    forwards, backwards = gained(1.0), gained(-1.0)
    sliding, slope = jax.jvp(lambda v: law.sliding_force(v, load), (jnp.asarray(speed),), (jnp.ones(()),))
    damping = jax.jvp(lambda v: law.force(v, straight, load), (still,), (jnp.ones(()),))[1]
    # A spring is as stiff in one direction as in the other; the memory of a rate-and-state law is none.
    spring = jnp.abs(forwards - backwards) <= _SAME * jnp.abs(forwards)
    return Force(
        jnp.asarray(law.dynamic_force(load)),
        sliding - speed * slope,
        sliding,
        jnp.where(spring, forwards, jnp.nan),
        damping,
    )


def scaled(
    values: Sequence[float],
    slopes: np.ndarray,
    now: float,
    aim: float,
    movable: Sequence[bool],
    lists: Sequence[int] | None = None,
) -> dict[int, float]:
    """Values of the movable coefficients, changed by one factor (or its inverse) so that a quantity meets its aim.

    Args:
        values: values of all coefficients.
        slopes: derivatives of the quantity by each of them.
        now: the quantity with these values.
        aim: what it should be.
        movable: which coefficients may change.
        lists: for each of them the number of the list that it belongs to, whose members change together; None where
            each stands for itself.
    """
    if not (now > 0 and aim > 0):
        return {}
    each = np.where(movable, slopes * np.asarray(values) / now, 0.0)
    members = np.arange(each.size) if lists is None else np.asarray(lists)
    elasticity = np.bincount(members, each, each.size)
    weight = float(np.sum(np.abs(elasticity)))
    if not (np.isfinite(weight) and weight > 0):
        return {}
    factors = np.exp(np.sign(elasticity) * np.log(aim / now) / weight)
    return {i: values[i] * float(factors[m]) for i, m in enumerate(members) if movable[i] and elasticity[m] != 0}


def contact_members(slopes: Force, known: Sequence[Coefficient], free: Mapping[int, Any]) -> tuple[list[bool], int]:
    """Free coefficients that scale the stiffness of the contact, and the one that alone adds damping to it or -1."""
    apart = (slopes.sliding == 0) & (slopes.dynamic == 0)
    stiff = [i in free and bool(apart[i]) and known[i].fitted_as != "value" for i in range(len(known))]
    damping = [i for i in free if apart[i] and slopes.damping[i] != 0 and slopes.stiffness[i] == 0]
    return stiff, damping[0] if len(damping) == 1 else -1
