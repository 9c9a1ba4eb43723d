"""Start values of a law's own coefficients: its friction force from the decay, its contact from the last reversal.

What the forces of a law say, not the names that it gives to its coefficients, tells which of them does what. A contact
that yields is a spring while it is bent little: ``dF/dt = K v``, with a damping beside it. Coefficients that change
this stiffness K, or this damping, but not the force of steady sliding, belong to the contact; those that change the
dynamic force carry the friction.
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


def terms_of(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[str, ...]:
    """What else the decay must tell for the start values of a law, as kinds for :func:`guess_machine`."""
    if not _is_needed(oscillator, leaves, free):
        return ()
    return ("mu", "returned") if oscillator.friction.n_states else ("mu",)


def _is_needed(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> bool:
    """Whether a free coefficient of the law is more than the one mu of a law without memory, or what follows it."""
    of_law, movable = _of_law(leaves, free)
    single = [leaf.kind for leaf in of_law].count("mu") == 1
    return bool(movable) and (oscillator.friction.n_states > 0 or not single)


def _of_law(leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[list[Leaf], dict[int, Leaf]]:
    """The coefficients of the law, and those of them that are free by their place among them."""
    of_law = [leaf for leaf in leaves if leaf.dotted.startswith(_FRICTION)]
    return of_law, {i: leaf for i, leaf in enumerate(of_law) if leaf in free}


def guess_law(
    oscillator: Oscillator,
    leaves: Sequence[Leaf],
    free: Sequence[Leaf],
    windows: Sequence[Window],
    known: Mapping[str, float],
) -> dict[str, float]:
    """Start values of the free coefficients of a law, by their names; those that no record tells are left out.

    Args:
        oscillator: the machine with the law as given.
        leaves: all coefficients of the oscillator.
        free: those that are fitted.
        windows: the records.
        known: the machine as the decay shows it, by kind, with the `terms_of` this law.
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
    """Largest values of the free coefficients that make a contact stiff, by their names.

    Beyond them the contact turns faster than all samples together can show.
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
    """Place of the first coefficient of the list that a coefficient belongs to; its own place where it is none."""
    stem = leaf.dotted.rsplit("_", 1)[0]
    alike = [other.dotted.rsplit("_", 1)[0] == stem and other.coefficient is leaf.coefficient for other in of_law]
    return alike.index(True)


class _Start:
    """Values of all coefficients of a law while they are brought to what the records show."""

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
        """Scale the coefficients, and lists of them, that carry the dynamic force, and a static one along with them."""
        now, slopes = self.forces()
        lists = [_list_of(leaf, self.of_law) for leaf in self.of_law]
        carrying = {lists[i] for i in movable if slopes.dynamic[i] != 0}
        carriers = [i in movable and lists[i] in carrying for i in range(len(self.of_law))]
        self.change(scaled(self.values, slopes.constant, now.constant, force, carriers, lists))
        static = {i: leaf for i, leaf in movable.items() if leaf.kind == "mu_s"}
        if self.changed and now.constant > 0:
            self.change({i: self.values[i] * force / now.constant for i in static})

    def meet_contact(self, movable: Mapping[int, Leaf], known: Mapping[str, float]) -> None:
        """Scale the coefficients that make the contact stiff, and set the one that damps it."""
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
    """The forces of a law, and their derivatives by its leaves."""
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
