"""What a friction law is: a force that resists sliding, possibly with a memory of its own.

With the oscillator written as ``m a + c v + drag v|v| + R(x) + F = 0``, a law says what ``F`` is. Three kinds exist,
and an engine asks only which one it has before it:

* *set-valued* laws (Coulomb, Stribeck) jump at ``v = 0`` and hold the mass at rest while the spring pulls with less
  than the static friction force;
* *regularised* laws (Tanh) replace the jump by a steep slope, and therefore creep where the mass would rest;
* *bristle* laws (LuGre) carry internal states, the deflection of the contact, and stick by means of these.
"""

import abc
import functools
from collections.abc import Iterable, Mapping
from itertools import accumulate
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from equinox import AbstractClassVar, AbstractVar
from jaxtyping import Array, Float

from .catalogue import Kind, check_summands
from .coefficient import Coefficient, check_coefficients

if TYPE_CHECKING:
    type Scalar = Array
    type Values = Array
    type State = Array
else:
    Scalar = Float[Array | np.ndarray, ""] | np.float64  # numpy turns products of its scalar arrays into np.float64
    Values = Float[Array | np.ndarray, "..."] | np.float64  # one number or many: laws of v and x act elementwise
    State = Float[Array | np.ndarray, " states"]


def scalar(value: Any) -> Any:
    """A coefficient as a leaf, the converter of its field: ``mu: float = eqx.field(converter=scalar)``.

    Args:
        value: a number, which becomes a float64 array of shape (); tracers and other objects pass unchanged.

    Raises:
        ValueError: a text.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.scalar(0.05)
        array(0.05)
    """
    if isinstance(value, str):
        raise ValueError(f"A coefficient must be a number in SI units, got the text {value!r}.")
    if isinstance(value, int | float | np.ndarray | np.generic):
        return np.asarray(value, dtype=np.float64)
    return value


def scalars(values: Iterable[Any]) -> tuple[Any, ...]:
    """A list of coefficients as leaves."""
    return tuple(scalar(value) for value in values)


def power(base: Values, exponent: Scalar) -> Values:
    """``|base|^exponent`` for an exponent of zero or more, with finite derivatives also where the base is zero."""
    # The stiff solver takes second derivatives, in which the inverse square of a lower floor would overflow.
    return jnp.exp(exponent * jnp.log(jnp.maximum(jnp.abs(base), 1e-150)))


def signed_power(base: Values, exponent: Scalar) -> Values:
    """``|base|^exponent sgn(base)`` for an exponent of one or more."""
    return base * power(base, exponent - 1.0)


# As a number of the host, for an array would cost a program to be made.
UNSCALED: Any = np.float64(np.inf)
"""The velocity scale of a law that has none."""


class AbstractFriction(eqx.Module):
    """A friction law; `load` is the normal force [N] everywhere, `v` the sliding velocity [m/s].

    Attributes:
        coefficients: what is known of each coefficient: unit, meaning, bounds.
        source: where the law was published.
        identifies: which coefficients a free decay identifies, in a sentence or two.
        set_valued: whether the force jumps at rest, where it holds the mass.
        n_states: number of internal states.

    Raises:
        ValueError: a coefficient outside of its bounds; names it with its value and the bound.
        TypeError: a number that `coefficients` does not describe.

    Examples:
        A law of one's own says what its coefficients are and how it resists steady sliding; this one is set-valued,
        and a fit takes it like any other.

        >>> import equinox as eqx
        >>> import jax.numpy as jnp
        >>> import numpy as np
        >>> from fricjax.friction import AbstractSetValued
        >>> from fricjax.friction.base import scalar
        >>> from fricjax.friction.coefficient import MU, positive
        >>> class Saturating(AbstractSetValued):
        ...     coefficients = {"mu": MU, "v_half": positive("m/s", "speed of half the rise")}
        ...     mu: float = eqx.field(converter=scalar)
        ...     v_half: float = eqx.field(converter=scalar)
        ...
        ...     def sliding_force(self, speed, load):
        ...         return self.mu * load * (1 + speed / (speed + self.v_half))
        >>> law = Saturating(mu=0.2, v_half=0.1)
        >>> law.kind, float(law.sliding_force(np.float64(0.1), np.float64(10.0)))
        ('set-valued', 3.0)
    """

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]
    source: ClassVar[str] = ""
    identifies: ClassVar[str] = ""
    set_valued: AbstractVar[bool]
    n_states: AbstractVar[int]

    def __check_init__(self) -> None:
        check_coefficients(self, self.coefficients, f" of {type(self).__name__}")

    @abc.abstractmethod
    def force(self, v: Values, state: State, load: Scalar) -> Values:
        """Friction force [N], positive where it opposes a positive velocity."""

    def force_of(self, v: Values, state: State, rate: State, load: Scalar) -> Values:
        """The same force where the rates of the internal states are at hand, for laws in which it depends on them."""
        return self.force(v, state, load)

    @abc.abstractmethod
    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        """Time derivative of the internal states; empty for a law without memory."""

    @abc.abstractmethod
    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        """Internal states after long sliding at velocity `v` in the given direction (+1 or -1)."""

    @abc.abstractmethod
    def state_scale(self, load: Scalar) -> State:
        """Typical size of each internal state, by which an integrator scales it."""

    @abc.abstractmethod
    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        """Force of steady sliding at `speed` >= 0 [N]; at zero the limit from above."""

    @abc.abstractmethod
    def static_force(self, load: Scalar) -> Scalar:
        """Largest force that holds the mass at rest between two half-cycles [N]."""

    @abc.abstractmethod
    def dynamic_force(self, load: Scalar) -> Scalar:
        """Dynamic (kinetic) friction force mu N [N], which sets the dead band."""

    def velocity_scale(self) -> Scalar:
        """Speed over which the sliding force changes fast near rest [m/s]; inf for a law without such a range."""
        return UNSCALED

    @property
    def kind(self) -> Kind:
        """What an engine asks for: a jump at rest, a smooth force, or internal states."""
        if self.n_states:
            return "bristle"
        return "set-valued" if self.set_valued else "smooth"

    def set_valued_limit(self) -> "AbstractFriction":
        """The set-valued law that a regularised one tends to; every other law returns itself."""
        return self

    @property
    def stiff(self) -> bool:
        """Whether an explicit integration in time would have to take far smaller steps than the motion asks for."""
        return True

    @property
    def has_fading_memory(self) -> bool:
        """Whether an error of the states fades over the travel in which they settle; elements that stick keep it."""
        return True

    @property
    def n_modes(self) -> int:
        """How many of the internal states, the last ones, only :meth:`return_map` changes: their rates are zero."""
        return 0

    @property
    def step_refinement(self) -> int:
        """How many times finer than usual the law must be integrated: steps of a half-cycle, or error of a step."""
        return 1

    def breakaway_force(self, load: Scalar) -> Scalar:
        """Largest force that holds the mass before its release, after it has stood [N]; no less than the static one."""
        return self.static_force(load)

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        """Internal states after a slow pull in the given direction (+1 or -1), with which a motion from rest begins."""
        # A million metres per second leaves dynamic friction alone; infinity would make the derivatives NaN.
        return self.steady_state(jnp.asarray(1e6), direction, load)

    def warnings(self, load: float) -> tuple[str, ...]:
        """What a user should know of these coefficients at this load [N], a sentence or two each; outside of traces."""
        return ()

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        """Quantities besides the velocity at whose changes of sign the rates of the states have a kink or a jump."""
        return jnp.zeros(0)

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        """Internal states after a step of an integration: what the integrated ones stand for as the motion goes on.

        Elements that stick or slip change their mode here, between two steps; other states are what they are. The
        acceleration `a` [m/s^2] tells how long ago in the step that was.
        """
        return state

    def reach(self, load: Scalar) -> State:
        """Largest size of each internal state that a motion leads to from a smaller one; inf where there is no bound.

        A step that is too long for the law, on a mesh that was made for a softer contact, would end beyond.
        """
        return jnp.full(self.n_states, jnp.inf)

    def __add__(self, other: "AbstractFriction") -> "AbstractFriction":
        return Sum(laws_of(self), laws_of(other))


class Sum(AbstractFriction):
    """The sum of laws; it jumps where one of them jumps, and strings their internal states together.

    Attributes:
        laws: the summands; a fit names their coefficients ``friction.0.mu``, ``friction.1.quadratic_drag`` and so on.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(0.2) + fj.friction.Viscous(3.0)
        >>> [type(part).__name__ for part in law.laws]
        ['Coulomb', 'Viscous']
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.0003, 2.03  ], dtype=float64)
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

    def warnings(self, load: float) -> tuple[str, ...]:
        return tuple(warning for law in self.laws for warning in law.warnings(load))

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
    def has_fading_memory(self) -> bool:
        return all(law.has_fading_memory for law in self.laws)

    @property
    def n_modes(self) -> int:
        return self.laws[-1].n_modes

    @property
    def step_refinement(self) -> int:
        return max(law.step_refinement for law in self.laws)

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

    def set_valued_limit(self) -> "Sum":
        # A sum with memory has no set-valued twin that an engine could integrate.
        return self if self.n_states else Sum(tuple(law.set_valued_limit() for law in self.laws))


def laws_of(law: AbstractFriction) -> tuple[AbstractFriction, ...]:
    """The laws that a sum is made of; of any other the law itself."""
    return law.laws if isinstance(law, Sum) else (law,)


def law_name(law: AbstractFriction) -> str:
    """What reports call a law: "Coulomb + QuadraticDrag"."""
    return " + ".join(type(part).__name__ for part in laws_of(law))
