"""Start values of a law's own coefficients: its friction force from the decay, its contact from the last reversal."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ..oscillator import Oscillator
from ..oscillator.leaves import Leaf
from .presliding import Machine, contact_of, stiffest
from .roles import contact_members, force_of, scaled
from .window import Window

_FRICTION = "friction."


def terms_of(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[str, ...]:
    """What else the decay must tell for the start values of a law, as kinds for :func:`guess_machine`."""
    if not _is_needed(oscillator, leaves, free):
        return ()
    return ("mu", "returned") if oscillator.friction.n_states else ("mu",)


def _is_needed(oscillator: Oscillator, leaves: Sequence[Leaf], free: Sequence[Leaf]) -> bool:
    """Whether a free coefficient of the law is more than the one mu of a law without memory, or what follows it."""
    own, movable = _own(leaves, free)
    single = [leaf.kind for leaf in own].count("mu") == 1
    return bool(movable) and (oscillator.friction.n_states > 0 or not single)


def _own(leaves: Sequence[Leaf], free: Sequence[Leaf]) -> tuple[list[Leaf], dict[int, Leaf]]:
    """The coefficients of the law, and those of them that are free by their place among them."""
    own = [leaf for leaf in leaves if leaf.dotted.startswith(_FRICTION)]
    return own, {i: leaf for i, leaf in enumerate(own) if leaf in free}


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
    own, movable = _own(leaves, free)
    start = _Start(oscillator, own, windows)
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
    own, movable = _own(leaves, free)
    if not (movable and oscillator.friction.n_states):
        return {}
    start = _Start(oscillator, own, windows)
    now, slopes = start.forces()
    stiff, _ = contact_members(slopes, [leaf.coefficient for leaf in own], movable)
    mass, stiffness, damping = (float(getattr(oscillator, name)) for name in ("mass", "stiffness", "damping"))
    aim = stiffest(windows, Machine(mass, stiffness, damping, now.dynamic))
    highest = scaled(start.values, slopes.stiffness, now.stiffness, aim, stiff)
    return {movable[i].name: value for i, value in highest.items() if value > start.values[i]}


def _list_of(leaf: Leaf, own: Sequence[Leaf]) -> int:
    """Place of the first coefficient of the list that a coefficient belongs to; its own place where it is none."""
    stem = leaf.dotted.rsplit("_", 1)[0]
    alike = [other.dotted.rsplit("_", 1)[0] == stem and other.coefficient is leaf.coefficient for other in own]
    return alike.index(True)


class _Start:
    """Values of all coefficients of a law while they are brought to what the records show."""

    def __init__(self, oscillator: Oscillator, own: Sequence[Leaf], windows: Sequence[Window]) -> None:
        self.oscillator, self.own, self.windows = oscillator, own, windows
        self.leaves, self.structure = jax.tree.flatten(oscillator.friction)
        self.values = [float(leaf) for leaf in self.leaves]
        self.changed: set[int] = set()
        found = windows[0].segmentation
        self.speed = found.amplitude * np.pi / found.half_period

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
        lists = [_list_of(leaf, self.own) for leaf in self.own]
        carrying = {lists[i] for i in movable if slopes.dynamic[i] != 0}
        carriers = [i in movable and lists[i] in carrying for i in range(len(self.own))]
        self.change(scaled(self.values, slopes.constant, now.constant, force, carriers, lists))
        static = {i: leaf for i, leaf in movable.items() if leaf.kind == "mu_s"}
        if self.changed and now.constant > 0:
            self.change({i: self.values[i] * force / now.constant for i in static})

    def meet_contact(self, movable: Mapping[int, Leaf], known: Mapping[str, float]) -> None:
        """Scale the coefficients that make the contact stiff, and set the one that damps it."""
        now, slopes = self.forces()
        stiff, damping = contact_members(slopes, [leaf.coefficient for leaf in self.own], movable)
        if not (any(stiff) or damping >= 0):
            return
        machine = Machine(known["mass"], known["stiffness"], known["damping"], now.dynamic)
        contact = contact_of(self.windows, machine, known.get("returned"))
        if contact.stiffness is not None:
            self.change(scaled(self.values, slopes.stiffness, now.stiffness, contact.stiffness, stiff))
        if contact.damping is not None and damping >= 0:
            more = (contact.damping - now.damping) / slopes.damping[damping]
            self.change({damping: max(self.values[damping] + float(more), 0.0)})
