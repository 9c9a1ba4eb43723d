"""Start values of a law from the decay and the last reversal.

The decay gives the friction force; the last reversal gives the contact. Derivatives of the forces, not the names of the
coefficients, determine the role of each coefficient. A contact that yields acts as a spring for small deflections:
``dF/dt = K v``, with parallel damping. Coefficients that change this stiffness K or this damping, but not the steady
sliding force, belong to the contact. Those that change the dynamic force carry the friction.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..friction import AbstractFriction
from ..friction.coefficient import Coefficient
from ..oscillator import Oscillator, Program
from ..oscillator.oscillator import Leaf
from .presliding import Machine, contact_of, stiffest
from .window import Window

_FRICTION = "friction."
_SAME = 1e-9


class Force(NamedTuple):
    """Forces of a law; for derivatives each has shape (coefficients,).

    Attributes:
        dynamic: dynamic force [N].
        constant: steady sliding force at the speed of the run minus its part proportional to speed [N]; the decay
            separates it from damping.
        sliding: steady sliding force at the speed of the run [N].
        stiffness: contact stiffness [N/m]; NaN for a law without elastic states.
        damping: contact damping at rest [N s/m].
    """

    dynamic: Any
    constant: Any
    sliding: Any
    stiffness: Any
    damping: Any


def terms_of(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[str, ...]:
    """Return the kinds that :func:`guess_machine` must estimate for this law."""
    if not _is_needed(oscillator, leaves, free):
        return ()
    return ("mu", "returned") if oscillator.friction.n_states else ("mu",)


def _is_needed(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> bool:
    """Return True if the law has free coefficients besides a single mu."""
    of_law, movable = _of_law(leaves, free)
    single = [leaf.kind for leaf in of_law].count("mu") == 1
    return bool(movable) and (oscillator.friction.n_states > 0 or not single)


def _of_law(leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[list[Leaf], dict[int, Leaf]]:
    """Return the coefficients of the law, and the free ones by index."""
    of_law = [leaf for leaf in leaves if leaf.dotted.startswith(_FRICTION)]
    return of_law, {i: leaf for i, leaf in enumerate(of_law) if leaf in free}


def guess_law(
    oscillator: Oscillator,
    leaves: Sequence[Leaf],
    free: Sequence[Leaf],
    windows: Sequence[Window],
    known: Mapping[str, float],
) -> dict[str, float]:
    """Return start values of the free coefficients of a law, by name.

    Coefficients that no record determines are omitted.

    Args:
        oscillator: the machine with the law as given.
        leaves: all coefficients of the oscillator.
        free: the free coefficients.
        windows: the records.
        known: the machine estimated from the decay, by kind, with the `terms_of` this law.
    """
    if not (windows and _is_needed(oscillator, leaves, free)):
        return {}
    of_law, movable = _of_law(leaves, free)
    start = _Start(oscillator, of_law, windows)
    start.meet_friction(movable, known["mu"] * known["normal_force"])
    if oscillator.friction.n_states:
        start.meet_contact(movable, known)
    return {leaf.name: start.values[i] for i, leaf in movable.items() if i in start.changed}


def highest_of(
    oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf], windows: Sequence[Window]
) -> dict[str, float]:
    """Return upper bounds of the free contact stiffness coefficients, by name.

    Beyond them the contact turns faster than all samples together can resolve.
    """
    of_law, movable = _of_law(leaves, free)
    if not (movable and oscillator.friction.n_states):
        return {}
    start = _Start(oscillator, of_law, windows)
    now, slopes = start.forces()
    stiff, _ = contact_members(slopes, [leaf.coefficient for leaf in of_law], movable)
    mass, stiffness, damping = (float(getattr(oscillator, name)) for name in ("mass", "stiffness", "damping"))
    aim = stiffest(windows, Machine(mass, stiffness, damping, now.dynamic))
    highest = scaled(start.values, slopes.stiffness, now.stiffness, aim, stiff)
    return {movable[i].name: value for i, value in highest.items() if value > start.values[i]}


def _list_of(leaf: Leaf, of_law: Sequence[Leaf]) -> int:
    """Return the index of the first coefficient in the same list."""
    stem = leaf.dotted.rsplit("_", 1)[0]
    alike = [other.dotted.rsplit("_", 1)[0] == stem and other.coefficient is leaf.coefficient for other in of_law]
    return alike.index(True)


class _Start:
    """Values of a law's coefficients during their adjustment to the records."""

    def __init__(self, oscillator: Oscillator, of_law: Sequence[Leaf], windows: Sequence[Window]) -> None:
        self.oscillator, self.of_law, self.windows = oscillator, of_law, windows
        self.leaves, self.structure = jax.tree.flatten(oscillator.friction)
        self.values = [float(leaf) for leaf in self.leaves]
        self.changed: set[int] = set()
        segmentation = windows[0].segmentation
        self.speed = segmentation.amplitude * np.pi / segmentation.half_period

    def forces(self) -> Any:
        law = jax.tree.unflatten(self.structure, [np.asarray(value) for value in self.values])
        return force_of(law, float(self.oscillator.normal_force), self.speed)

    def change(self, values: Mapping[int, float]) -> None:
        for i, value in values.items():
            self.values[i] = value
            self.changed.add(i)

    def meet_friction(self, movable: Mapping[int, Leaf], force: float) -> None:
        """Scale the coefficients that carry the dynamic force, and mu_s with them."""
        now, slopes = self.forces()
        lists = [_list_of(leaf, self.of_law) for leaf in self.of_law]
        carrying = {lists[i] for i in movable if slopes.dynamic[i] != 0}
        carriers = [i in movable and lists[i] in carrying for i in range(len(self.of_law))]
        self.change(scaled(self.values, slopes.constant, now.constant, force, carriers, lists))
        static = {i: leaf for i, leaf in movable.items() if leaf.kind == "mu_s"}
        if self.changed and now.constant > 0:
            self.change({i: self.values[i] * force / now.constant for i in static})

    def meet_contact(self, movable: Mapping[int, Leaf], known: Mapping[str, float]) -> None:
        """Scale the contact stiffness coefficients, and set the damping one."""
        now, slopes = self.forces()
        stiff, damping = contact_members(slopes, [leaf.coefficient for leaf in self.of_law], movable)
        if not (any(stiff) or damping >= 0):
            return
        machine = Machine(known["mass"], known["stiffness"], known["damping"], now.dynamic)
        contact = contact_of(self.windows, machine, known.get("returned"))
        if contact.stiffness is not None:
            self.change(scaled(self.values, slopes.stiffness, now.stiffness, contact.stiffness, stiff))
        if contact.damping is not None and damping >= 0:
            more = (contact.damping - now.damping) / slopes.damping[damping]
            self.change({damping: max(self.values[damping] + float(more), 0.0)})


def force_of(law: AbstractFriction, load: float, speed: float) -> tuple[Force, Force]:
    """Return the forces of a law and their derivatives by its leaves."""
    values, slopes = _force_of(jax.tree.map(np.asarray, law), np.float64(load), np.float64(speed))
    return Force(*map(float, values)), Force(*map(np.asarray, slopes))


def _differentiated(law: AbstractFriction, load: Any, speed: Any) -> tuple[Force, Force]:
    leaves, structure = jax.tree.flatten(law)

    def forces(values: Any) -> tuple[Force, Force]:
        forces_now = _forces(jax.tree.unflatten(structure, list(values)), load, speed)
        return forces_now, forces_now

    slopes, values = jax.jacfwd(forces, has_aux=True)(jnp.stack([jnp.asarray(leaf, float) for leaf in leaves]))
    return values, slopes


_force_of = Program(_differentiated, lambda *_: (Force(*range(5)), Force(*range(5))))


def _forces(law: AbstractFriction, load: Any, speed: Any) -> Force:
    straight, still = jnp.zeros(law.n_states), jnp.zeros(())

    def gained(v: Any) -> Any:
        """Return the force gained per displacement of a relaxed contact."""
        rate = law.rate(jnp.asarray(v), straight, load) / v
        return jax.jvp(lambda state: law.force(still, state, load), (straight,), (rate,))[1]

    forwards, backwards = gained(1.0), gained(-1.0)
    sliding, slope = jax.jvp(lambda v: law.sliding_force(v, load), (jnp.asarray(speed),), (jnp.ones(()),))
    damping = jax.jvp(lambda v: law.force(v, straight, load), (still,), (jnp.ones(()),))[1]
    # A spring is equally stiff in both directions; the state of a rate-and-state law is no spring.
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
    """Scale the movable coefficients so that a quantity reaches its target.

    All change by one factor, or by its inverse if the quantity decreases with the coefficient.

    Args:
        values: values of all coefficients.
        slopes: derivatives of the quantity with respect to each of them.
        now: the quantity with these values.
        aim: its target.
        movable: True for coefficients that may change.
        lists: for each coefficient the number of its list; members of a list change together. None for no lists.
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
    """Return flags of the free stiffness coefficients, and the damping coefficient's index.

    The index is that of the only coefficient that adds damping but no stiffness, or -1.
    """
    apart = (slopes.sliding == 0) & (slopes.dynamic == 0)
    stiff = [i in free and bool(apart[i]) and known[i].fitted_as != "value" for i in range(len(known))]
    damping = [i for i in free if apart[i] and slopes.damping[i] != 0 and slopes.stiffness[i] == 0]
    return stiff, damping[0] if len(damping) == 1 else -1
