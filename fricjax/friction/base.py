"""What a friction law is: a force that resists sliding, possibly with a memory of its own.

With the oscillator written as ``m a + c v + drag v|v| + R(x) + F = 0``, a law says what ``F`` is. Three kinds exist,
and an engine asks only which one it has before it:

* *set-valued* laws (Coulomb, Stribeck) jump at ``v = 0`` and hold the mass at rest while the spring pulls with less
  than the static friction force;
* *regularised* laws (Tanh) replace the jump by a steep slope, and therefore creep where the mass would rest;
* *bristle* laws (LuGre) carry internal states, the deflection of the contact, and stick by means of these.
"""

import abc
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from equinox import AbstractClassVar, AbstractVar
from jaxtyping import Array, Float

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
    """A coefficient as a leaf: numbers become float64 zero-dimensional arrays, arrays and tracers pass unchanged."""
    if isinstance(value, str):
        raise ValueError(f"A coefficient must be a number in SI units, got the text {value!r}.")
    if isinstance(value, int | float | np.ndarray | np.generic):
        return np.asarray(value, dtype=np.float64)
    return value


def scalars(values: Iterable[Any]) -> tuple[Any, ...]:
    """A list of coefficients as leaves."""
    return tuple(scalar(value) for value in values)


# As a number of the host, for an array would cost a program to be made.
UNSCALED: Any = np.float64(np.inf)
"""The velocity scale of a law that has none."""


class AbstractFriction(eqx.Module):
    """A friction law; `load` is the normal force [N] everywhere, `v` the sliding velocity [m/s].

    Attributes:
        coefficients: what is known of each coefficient: unit, meaning, bounds.
        source: where the law was published.
        identifies: what a free decay can and cannot tell of the coefficients, in a sentence or two.
        set_valued: whether the force jumps at rest, where it holds the mass.
        n_states: number of internal states.

    Raises:
        ValueError: a coefficient outside of its bounds; names it with its value and the bound.
        TypeError: a number that `coefficients` does not describe.
    """

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]
    source: AbstractClassVar[str]
    identifies: AbstractClassVar[str]
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

    @abc.abstractmethod
    def velocity_scale(self) -> Scalar:
        """Speed over which the sliding force changes fast near rest [m/s]; inf for a law without such a range."""

    def sharp(self) -> "AbstractFriction":
        """The set-valued law that a regularised one tends to; every other law returns itself."""
        return self

    @property
    def stiff(self) -> bool:
        """Whether an explicit integration in time would have to take far smaller steps than the motion asks for."""
        return True

    @property
    def forgets(self) -> bool:
        """Whether an error of the states fades over the travel in which they settle; elements that stick keep it."""
        return True

    @property
    def n_modes(self) -> int:
        """How many of the internal states, the last ones, only :meth:`return_map` changes: their rates are zero."""
        return 0

    @property
    def refinement(self) -> int:
        """How many times finer than usual the law must be integrated: steps of a half-cycle, or error of a step."""
        return 1

    def breakaway_force(self, load: Scalar) -> Scalar:
        """Largest force that holds the mass before its release, after it has stood [N]; no less than the static one."""
        return self.static_force(load)

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        """Internal states after a slow pull in the given direction (+1 or -1), with which a motion from rest begins."""
        # A million metres per second leaves dynamic friction alone; infinity would make the derivatives NaN.
        return self.steady_state(jnp.asarray(1e6), direction, load)

    def remarks(self, load: float) -> tuple[str, ...]:
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
        from .sum import Sum

        return Sum(*(law.laws if isinstance(law, Sum) else (law,) for law in (self, other)))


class AbstractMemoryless(AbstractFriction):
    """A law without internal states: the force is a function of velocity and load alone."""

    n_states: ClassVar[int] = 0

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return jnp.zeros(0)

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.zeros(0)

    def state_scale(self, load: Scalar) -> State:
        return jnp.zeros(0)


class AbstractBristle(AbstractFriction):
    """A law with internal states, by whose deflection it holds the mass at rest."""

    set_valued: ClassVar[bool] = False


class AbstractSetValued(AbstractMemoryless):
    """A memoryless law with a jump at rest; its zero-velocity limit is at most its static force."""

    set_valued: ClassVar[bool] = True

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return jnp.sign(v) * self.sliding_force(jnp.abs(v), load)


class AbstractConstant(AbstractSetValued):
    """A set-valued law whose force does not depend on how fast the mass slides."""

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)

    def velocity_scale(self) -> Scalar:
        return UNSCALED


class AbstractSmooth(AbstractMemoryless):
    """A memoryless law without a jump: it holds nothing at rest."""

    set_valued: ClassVar[bool] = False

    def static_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)


class AbstractResistance(AbstractSmooth):
    """What grows with the speed from zero, such as drag: a summand that neither holds nor stops the mass."""

    def dynamic_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)

    @property
    def stiff(self) -> bool:
        return False

    def velocity_scale(self) -> Scalar:
        return UNSCALED
