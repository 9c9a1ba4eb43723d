"""Base class of friction laws, and sums of laws.

With the equation of motion ``m a + c v + drag v|v| + R(x) + F = 0``, a law defines the friction force ``F``. The engine
of a simulation depends on the kind of the law. There are three kinds:

* *set-valued* laws (Coulomb, Stribeck) jump at ``v = 0``. They hold the mass at rest while the pull of the spring is
  smaller than the static friction force;
* *regularised* laws (Tanh) replace the jump by a steep slope. With them a mass creeps instead of resting;
* *bristle* laws (LuGre) have internal states, the deflection of the contact. The deflected contact holds the mass.
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
    """Convert a coefficient to a leaf of the module.

    Use it as the converter of a field: ``mu: float = eqx.field(converter=scalar)``.

    Args:
        value: a number, which becomes a float64 array of shape (); tracers and other objects are returned unchanged.

    Raises:
        ValueError: the value is a string.

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
    """Convert a list of coefficients to leaves of the module."""
    return tuple(scalar(value) for value in values)


def power(base: Values, exponent: Scalar) -> Values:
    """Compute ``|base|^exponent`` for a non-negative exponent.

    The derivatives are finite even for a base of zero.
    """
    # The stiff solver takes second derivatives; with a smaller floor its inverse square would overflow.
    return jnp.exp(exponent * jnp.log(jnp.maximum(jnp.abs(base), 1e-150)))


def signed_power(base: Values, exponent: Scalar) -> Values:
    """Compute ``|base|^exponent sgn(base)`` for an exponent of at least one."""
    return base * power(base, exponent - 1.0)


# A NumPy number: a JAX array would have to be compiled.
UNSCALED: Any = np.float64(np.inf)
"""Velocity scale of a law without one."""


class AbstractFriction(eqx.Module):
    """Base class of friction laws.

    In all methods `load` is the normal force [N] and `v` the sliding velocity [m/s].

    Attributes:
        coefficients: unit, meaning and bounds of each coefficient.
        source: publication of the law.
        identifies: the coefficients that a free decay identifies, in a sentence or two.
        set_valued: whether the force jumps at zero velocity and holds the mass at rest.
        n_states: number of internal states.

    Raises:
        ValueError: a coefficient is outside its bounds; the message names the coefficient, its value and the bound.
        TypeError: a numerical field has no entry in `coefficients`.

    Examples:
        A user-defined law declares its coefficients and its force of steady sliding. This law is set-valued, and `fit`
        accepts it like any other law.

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
        """Friction force [N]; a positive force opposes a positive velocity."""

    def force_of(self, v: Values, state: State, rate: State, load: Scalar) -> Values:
        """Friction force [N] from the known rates of the internal states."""
        return self.force(v, state, load)

    @abc.abstractmethod
    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        """Time derivative of the internal states; empty for a law without memory."""

    @abc.abstractmethod
    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        """Internal states of steady sliding at velocity `v`.

        The direction is +1 or -1; it is needed for a velocity of zero.
        """

    @abc.abstractmethod
    def state_scale(self, load: Scalar) -> State:
        """Typical size of each internal state, for scaling by an integrator."""

    @abc.abstractmethod
    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        """Force of steady sliding at `speed` >= 0 [N].

        At zero it is the limit from above.
        """

    @abc.abstractmethod
    def static_force(self, load: Scalar) -> Scalar:
        """Largest force that holds the mass at rest between two half-cycles [N]."""

    @abc.abstractmethod
    def dynamic_force(self, load: Scalar) -> Scalar:
        """Dynamic (kinetic) friction force mu N [N], which sets the dead band."""

    def velocity_scale(self) -> Scalar:
        """Speed range near rest in which the sliding force changes fast [m/s].

        It is infinite for a law without such a range.
        """
        return UNSCALED

    @property
    def kink_speeds(self) -> tuple[float, ...]:
        """Speeds at which a derivative of the sliding force jumps [m/s]."""
        return ()

    @property
    def kind(self) -> Kind:
        """Kind of the law, which determines the engines that can integrate it."""
        if self.n_states:
            return "bristle"
        return "set-valued" if self.set_valued else "smooth"

    def set_valued_limit(self) -> "AbstractFriction":
        """Limit of a regularised law without regularisation; other laws return themselves."""
        return self

    @property
    def stiff(self) -> bool:
        """True if explicit integration needs far smaller steps than the motion."""
        return True

    @property
    def has_fading_memory(self) -> bool:
        """True if an error of the internal states decays during sliding.

        Elements that stick keep such an error.
        """
        return True

    @property
    def n_modes(self) -> int:
        """Number of trailing internal states that only :meth:`return_map` changes.

        Their rates are zero.
        """
        return 0

    @property
    def step_refinement(self) -> int:
        """Factor by which the integration must be finer than usual.

        It multiplies the number of steps per half-cycle, or divides the error tolerance of a step.
        """
        return 1

    def breakaway_force(self, load: Scalar) -> Scalar:
        """Largest force that holds the mass before its release [N].

        It is at least the static force, and may depend on the time of rest.
        """
        return self.static_force(load)

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        """Initial internal states of a motion from rest.

        They follow from a slow pull in the given direction (+1 or -1).
        """
        # At a million metres per second only dynamic friction remains; infinity would make the derivatives NaN.
        return self.steady_state(jnp.asarray(1e6), direction, load)

    def warnings(self, load: float) -> tuple[str, ...]:
        """Warnings about these coefficients at this load [N].

        Do not call it under a trace of JAX.
        """
        return ()

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        """Quantities that change sign where the rates kink or jump.

        The velocity is not included.
        """
        return jnp.zeros(0)

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        """Correct the internal states after a step of the integration.

        Elements that stick or slip change their mode here, between two steps; other states are unchanged. The
        acceleration `a` [m/s^2] gives the time since the change within the step.
        """
        return state

    def reach(self, load: Scalar) -> State:
        """Bound on each internal state during a motion; inf without bound.

        A state beyond the bound shows that a step was too long for the law, for example on a mesh for a softer contact.
        """
        return jnp.full(self.n_states, jnp.inf)

    def __add__(self, other: "AbstractFriction") -> "AbstractFriction":
        return Sum(laws_of(self), laws_of(other))


class Sum(AbstractFriction):
    """Sum of friction laws.

    The sum is set-valued if one of the laws is. Its internal states are those of the laws, one after another.

    Attributes:
        laws: the summands. In a fit their coefficients have the names ``friction.0.mu``, ``friction.1.quadratic_drag``
            and so on.

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
    identifies: ClassVar[str] = "the coefficients of its laws, if their forces depend differently on the velocity."

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

    @property
    def kink_speeds(self) -> tuple[float, ...]:
        return tuple(sorted({speed for law in self.laws for speed in law.kink_speeds}))

    def set_valued_limit(self) -> "Sum":
        # No engine could integrate a set-valued limit of a sum with internal states.
        return self if self.n_states else Sum(tuple(law.set_valued_limit() for law in self.laws))


def laws_of(law: AbstractFriction) -> tuple[AbstractFriction, ...]:
    """Return the summands of a sum, or the law in a tuple."""
    return law.laws if isinstance(law, Sum) else (law,)


def law_name(law: AbstractFriction) -> str:
    """Name of a law in reports, such as "Coulomb + QuadraticDrag"."""
    return " + ".join(type(part).__name__ for part in laws_of(law))
