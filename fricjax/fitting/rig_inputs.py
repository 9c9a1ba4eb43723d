"""What the uncertain inputs of a rig change in the machine and in the reading of its instrument.

And whether the numbers of the machine can be those of the record at all.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import UsageError
from ..oscillator import Oscillator
from ..oscillator.oscillator import leaves_of
from ..rig import Measured, Rig
from .residual import ERRORS

# Of record and machine the ratio of natural frequencies, squared, beyond which a number of the machine is a mistake. A
# start value may be wrong by some factor, and damping or a nonlinear spring shift a frequency by less than two.
_CONTRADICTED = 10.0
# By the power of ten of this ratio the mistake of units that makes it; within half a power it is named.
_MISTAKES = {
    3: "A mass in g that is given as if in kg does this, and a stiffness in N/mm as if in N/m.",
    -3: "A stiffness in N/m that is given as if in N/mm does this.",
    6: "Times in s that are read as ms do this.",
    -6: "Times in ms that are read as s do this.",
}

# The errors of a reading that an input of the rig stands for; of a periodic one the phase is not known.
_OF_READING = {
    "displacement_scale": ("displacement_scale",),
    "time_scale": ("time_scale",),
    "periodic_nonlinearity": ("periodic_nonlinearity_cosine", "periodic_nonlinearity_sine"),
}


class RigInputs(NamedTuple):
    """The uncertain inputs of a rig.

    Attributes:
        measured: the inputs by name; a periodic nonlinearity is two, for its phase is not known.
        changes: change of each leaf of the machine for one standard uncertainty of each input; behind the leaves, where
            `period` is not None, of each error of the reading.
        period: of a periodic error [m], inf without one; None where the reading has no uncertain errors at all.
    """

    measured: dict[str, Measured]
    changes: Float[np.ndarray, "inputs changes"]
    period: np.ndarray | None


def rig_inputs(rig: Rig | None, oscillator: Oscillator, free: set[int]) -> RigInputs:
    """The uncertain inputs of a rig.

    Args:
        rig: the rig, or None for none.
        oscillator: the machine that is fitted.
        free: leaves that are fitted, and may differ from the rig's.

    Raises:
        UsageError: a rig that describes another machine.
    """
    leaves = len(jax.tree.leaves(oscillator))
    if rig is None:
        return RigInputs({}, np.zeros((0, leaves)), None)
    inputs, changes, known = rig.inputs(), {}, {}
    for name, measured in inputs.items():
        if name not in _OF_READING:
            known[name] = measured
            changes[name] = np.append(_of_machine(rig, name, oscillator, free), np.zeros(len(ERRORS)))
        for error in _OF_READING.get(name, ()):
            changes[error] = np.append(np.zeros(leaves), [measured.std * (error == other) for other in ERRORS])
            known[error] = measured
    rows = np.array(list(changes.values())).reshape(-1, leaves + len(ERRORS))
    if not inputs.keys() & _OF_READING.keys():
        return RigInputs(known, rows[:, :leaves], None)
    period = rig.nonlinearity_period
    return RigInputs(known, rows, np.asarray(np.inf if period is None else period.value))


def _of_machine(rig: Rig, name: str, oscillator: Oscillator, free: set[int]) -> Float[np.ndarray, " leaves"]:
    """Change of each leaf of the machine for one standard uncertainty of an input."""
    measured = rig.inputs()[name]

    def machine(b: Array) -> Oscillator:
        return rig.with_inputs({name: b}).oscillator(oscillator.friction)

    at, by = jnp.asarray(float(measured.value)), jnp.asarray(float(measured.std))
    made, change = jax.jvp(machine, (at,), (by,))
    if jax.tree.structure(change) != jax.tree.structure(oscillator):
        raise UsageError(
            "The rig describes another machine than the oscillator. Build it with rig.oscillator(friction)."
        )
    _check_same(made, oscillator, free)
    return np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(change)])


def _check_same(made: Oscillator, oscillator: Oscillator, free: set[int]) -> None:
    """Refuse a rig whose numbers are not those of the oscillator, where these are not fitted."""
    for leaf, ours, theirs in zip(leaves_of(oscillator), *map(jax.tree.leaves, (oscillator, made)), strict=True):
        if leaf.index not in free and not np.isclose(float(ours), float(theirs), rtol=1e-9, atol=0):
            raise UsageError(
                f"The rig gives {leaf.name} = {float(theirs):.9g}, but the oscillator has {float(ours):.9g}. Build it "
                "with rig.oscillator(friction)."
            )


def contradiction(oscillator: Oscillator, half_period: float) -> tuple[str, ...]:
    """A sentence where the record swings at a frequency that the machine cannot have; else nothing.

    Args:
        oscillator: the machine at its start values.
        half_period: of the record [s].
    """
    # A unit mass stands for an unknown one, and a unit stiffness for one that the record is to tell.
    if 1.0 in (float(oscillator.mass), float(oscillator.stiffness)):
        return ()
    # By numbers of the host: an operation of JAX is a program of its own, which a first fit would wait for.
    machine = math.sqrt(float(oscillator.stiffness) / float(oscillator.mass)) / (2 * math.pi)
    record = 0.5 / half_period
    ratio = (record / machine) ** 2
    # A contact that holds the mass may be far stiffer than the spring, and the mass then rings on it.
    rings = bool(oscillator.friction.n_states) and ratio > 1
    if rings or not machine > 0 or 1 / _CONTRADICTED < ratio < _CONTRADICTED:
        return ()
    power = math.log10(ratio)
    mistake = next((text for at, text in _MISTAKES.items() if abs(power - at) < 0.5), "Is one of them in another unit?")
    return (
        f"By its stiffness and mass the machine swings at {machine:.4g} Hz, but the record at {record:.4g} Hz: check "
        f"stiffness and mass, from which damping and friction follow, and the unit of the time. {mistake}",
    )
