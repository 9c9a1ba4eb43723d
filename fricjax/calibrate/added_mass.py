"""The moving mass from two natural frequencies, without and with a known mass on top.

The same spring swings both, ``k = m w1^2 = (m + dm) w2^2``, so that ``m = dm/(w1^2/w2^2 - 1)``. Frequencies are known
to 1e-6 from a ring-down and masses to 1e-5 from a balance: this is the best way to the mass, and with it to the
stiffness. Leaf springs that carry load change their stiffness with it: put the mass where it loads them as before.
"""

from ..errors import UsageError
from ..rig.measured import Measured
from ..rig.propagate import positive, propagated
from ..rig.quantity import quantity
from ..rig.rig import Number


def calibrate_added_mass(frequency: Number, frequency_loaded: Number, added_mass: Number) -> Measured:
    """The moving mass [kg].

    Args:
        frequency: undamped natural frequency of the bare rig [Hz], as a number, a `Measured` or a text with a unit.
        frequency_loaded: the same with the mass added [Hz].
        added_mass: the mass added [kg].

    Returns:
        The mass with its standard uncertainty to first order; for a rotary rig the moment of inertia [kg m^2].

    Raises:
        UsageError: a value that is not positive, or a loaded frequency that is not the lower one.
    """
    bare = positive("frequency", "Hz", quantity("frequency", frequency))
    loaded = positive("frequency_loaded", "Hz", quantity("frequency", frequency_loaded))
    added = positive("added_mass", "kg", quantity("mass", added_mass))
    if not loaded.value < bare.value:
        raise UsageError(
            f"frequency_loaded must be lower than frequency, for mass slows a spring down; got {loaded.value:.9g} Hz "
            f"with and {bare.value:.9g} Hz without the added mass. Perhaps they are swapped."
        )
    return propagated(lambda f1, f2, dm: dm * f2**2 / ((f1 - f2) * (f1 + f2)), bare, loaded, added)
