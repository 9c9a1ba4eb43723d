"""Several friction forces that act at once, built by ``+``."""

import functools
from collections.abc import Mapping
from itertools import accumulate
from typing import ClassVar

import jax.numpy as jnp

from .base import AbstractFriction, Scalar, State, Values
from .catalogue import check_summands
from .coefficient import Coefficient


class Sum(AbstractFriction):
    """The sum of laws; it jumps where one of them jumps, and strings their internal states together.

    Attributes:
        laws: the summands; a fit names their coefficients ``friction.0.mu``, ``friction.1.windage`` and so on.
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}
    source: ClassVar[str] = "Superposition of forces"
    identifies: ClassVar[str] = "What its laws tell, as far as their forces depend on velocity in different ways."

    laws: tuple[AbstractFriction, ...]

    def __init__(self, *groups: tuple[AbstractFriction, ...]) -> None:
        self.laws = tuple(law for group in groups for law in group)
        names = [type(law).__name__ for law in self.laws]
        check_summands(names, jumps=self.set_valued, remembers=self.n_states > 0)

    @property
    def set_valued(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return any(law.set_valued for law in self.laws)

    @property
    def n_states(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return sum(law.n_states for law in self.laws)

    def _split(self, state: State) -> list[Values]:
        ends = list(accumulate(law.n_states for law in self.laws))
        return [state[end - law.n_states : end] for law, end in zip(self.laws, ends, strict=True)]

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        parts = zip(self.laws, self._split(state), strict=True)
        return sum((law.force(v, part, load) for law, part in parts), start=jnp.zeros_like(v))

    def force_of(self, v: Values, state: State, rate: State, load: Scalar) -> Values:
        parts = zip(self.laws, self._split(state), self._split(rate), strict=True)
        return sum((law.force_of(v, z, change, load) for law, z, change in parts), start=jnp.zeros_like(v))

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        parts = zip(self.laws, self._split(state), strict=True)
        return jnp.concatenate([law.rate(v, part, load) for law, part in parts])

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.concatenate([law.steady_state(v, direction, load) for law in self.laws])

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        return jnp.concatenate([law.pulled_state(direction, load) for law in self.laws])

    def remarks(self, load: float) -> tuple[str, ...]:
        return tuple(remark for law in self.laws for remark in law.remarks(load))

    def state_scale(self, load: Scalar) -> State:
        return jnp.concatenate([law.state_scale(load) for law in self.laws])

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return sum((law.sliding_force(speed, load) for law in self.laws), start=jnp.zeros_like(speed))

    def static_force(self, load: Scalar) -> Scalar:
        return sum((law.static_force(load) for law in self.laws), start=jnp.zeros_like(load))

    def breakaway_force(self, load: Scalar) -> Scalar:
        return sum((law.breakaway_force(load) for law in self.laws), start=jnp.zeros_like(load))

    def dynamic_force(self, load: Scalar) -> Scalar:
        return sum((law.dynamic_force(load) for law in self.laws), start=jnp.zeros_like(load))

    @property
    def stiff(self) -> bool:
        return any(law.stiff for law in self.laws)

    @property
    def forgets(self) -> bool:
        return all(law.forgets for law in self.laws)

    @property
    def n_modes(self) -> int:
        return self.laws[-1].n_modes

    @property
    def refinement(self) -> int:
        return max(law.refinement for law in self.laws)

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        parts = zip(self.laws, self._split(state), strict=True)
        return jnp.concatenate([law.switches(v, part, load) for law, part in parts])

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        parts = zip(self.laws, self._split(state), strict=True)
        return jnp.concatenate([law.return_map(v, a, part, load) for law, part in parts])

    def reach(self, load: Scalar) -> State:
        return jnp.concatenate([law.reach(load) for law in self.laws])

    def velocity_scale(self) -> Scalar:
        return functools.reduce(jnp.minimum, (law.velocity_scale() for law in self.laws))

    def sharp(self) -> "Sum":
        # A sum with memory has no set-valued twin that an engine could integrate.
        return self if self.n_states else Sum(tuple(law.sharp() for law in self.laws))
