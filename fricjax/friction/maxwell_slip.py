"""Maxwell-slip friction (Iwan, 1966).

It is a rate-independent hysteresis with a memory of every reversal.
"""

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, Values, scalar, scalars
from .coefficient import MU_BRISTLE, SIGMA0, Coefficient, positive
from .elements import AbstractElements


class MaxwellSlip(AbstractElements):
    """Maxwell-slip model.

    ``F = sum F_i`` with ``dF_i/dt = stiffnesses_i v`` while ``|F_i| < limits_i N``, and zero beyond.

    From a virgin contact the force rises along a piecewise linear curve. At the displacement
    ``limits_i N/stiffnesses_i`` its slope falls by ``stiffnesses_i``. After a reversal the force follows the same curve
    at twice its size (Masing's rule), and an inner loop closes at its start. With enough elements the model
    approximates any curve of falling slope. Stiffnesses do not scale with the load.

    Attributes:
        stiffnesses: stiffness of each element [N/m].
        limits: force at which each element slips, per load [1]; their sum is the coefficient of friction.

    Raises:
        ValueError: there are no elements, or the numbers of limits and stiffnesses differ.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.MaxwellSlip(stiffnesses=[1e5, 5e4], limits=[0.12, 0.08])
        >>> load = np.float64(10.0)
        >>> [round(float(1e6 * z), 1) for z in law.limits_of_deflection(load)]  # um at which each element slips
        [12.0, 16.0]
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "stiffnesses": positive("N/m", "stiffness of an element"),
        "limits": positive("", "force at which an element slips, per load"),
    }
    source: ClassVar[str] = (
        "W. D. Iwan, J. Appl. Mech. 33 (1966); F. Al-Bender and J. Swevers, IEEE Control Syst. 28 (2008)"
    )
    identifies: ClassVar[str] = (
        "the sum of the limits as mu in Coulomb's law; stiffnesses and limits separately if the elements yield at "
        "displacements between the resolution and the last half-cycles, otherwise only the sums of neighbours."
    )

    stiffnesses: tuple[Scalar, ...]
    limits: tuple[Scalar, ...]

    def __init__(self, stiffnesses: Iterable[Any], limits: Iterable[Any]) -> None:
        self.stiffnesses, self.limits = scalars(stiffnesses), scalars(limits)

    def __check_init__(self) -> None:
        if not self.limits or len(self.limits) != len(self.stiffnesses):
            raise ValueError(
                "MaxwellSlip needs one limit for each stiffness, and at least one of both, got "
                f"{len(self.stiffnesses)} stiffnesses and {len(self.limits)} limits."
            )

    @property
    def n_states(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return len(self.limits)

    def springs(self) -> Values:
        return jnp.stack(self.stiffnesses)

    def sliders(self) -> Values:
        return jnp.stack(self.limits)


class Jenkins(AbstractElements):
    """Coulomb's law in series with one spring.

    ``dF/dt = sigma0 v`` while ``|F| < mu N``, and zero beyond.

    Attributes:
        mu: dynamic coefficient of friction [1].
        sigma0: stiffness of the contact before it slides [N/m], independent of the load.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Jenkins(mu=0.2, sigma0=1e5)
        >>> [round(float(1e6 * z), 1) for z in law.limits_of_deflection(np.float64(10.0))]  # um at which it slips
        [20.0]
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"mu": MU_BRISTLE, "sigma0": SIGMA0}
    source: ClassVar[str] = "G. M. Jenkins, Brit. J. Appl. Phys. 13 (1962)"
    identifies: ClassVar[str] = (
        "mu as in Coulomb's law; sigma0 from the energy that each reversal returns and from the ringing at rest."
    )
    n_states: ClassVar[int] = 1

    mu: Scalar = eqx.field(converter=scalar)
    sigma0: Scalar = eqx.field(converter=scalar, default=1e5)

    def springs(self) -> Values:
        return jnp.reshape(self.sigma0, (1,))

    def sliders(self) -> Values:
        return jnp.reshape(self.mu, (1,))
