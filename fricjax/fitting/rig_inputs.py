"""Effect of the uncertain rig inputs on machine and reading.

It also checks that the record's frequency is consistent with the machine.
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

# Largest plausible ratio of the squared natural frequencies of record and machine. A start value may be wrong by some
# factor; damping or a nonlinear spring change a frequency by less than a factor two.
_CONTRADICTED = 10.0
# Typical mistake of units by the power of ten of this ratio, for ratios within half a power.
_MISTAKES = {
    3: "Typical cause: a mass in g entered as kg, or a stiffness in N/mm entered as N/m.",
    -3: "Typical cause: a stiffness in N/m entered as N/mm.",
    6: "Typical cause: times in s read as ms.",
    -6: "Typical cause: times in ms read as s.",
}

# Errors of a reading for each rig input; a periodic one has an unknown phase, hence two components.
_OF_READING = {
    "displacement_scale": ("displacement_scale",),
    "time_scale": ("time_scale",),
    "periodic_nonlinearity": ("periodic_nonlinearity_cosine", "periodic_nonlinearity_sine"),
}


class RigInputs(NamedTuple):
    """The uncertain inputs of a rig.

    Attributes:
        measured: the inputs by name; a periodic nonlinearity has two entries, because its phase is unknown.
        changes: change of each leaf of the machine per standard uncertainty of each input. If `period` is not None,
            changes of each error of the reading follow.
        period: period of a periodic error [m], inf without one; None without uncertain errors of the reading.
    """

    measured: dict[str, Measured]
    changes: Float[np.ndarray, "inputs changes"]
    period: np.ndarray | None


def rig_inputs(rig: Rig | None, oscillator: Oscillator, free: set[int]) -> RigInputs:
    """Collect the uncertain inputs of a rig.

    Args:
        rig: the rig, or None.
        oscillator: the fitted machine.
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
    """Return the change of each leaf per standard uncertainty of an input."""
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
    """Refuse a rig with other fixed values than the oscillator."""
    for leaf, ours, theirs in zip(leaves_of(oscillator), *map(jax.tree.leaves, (oscillator, made)), strict=True):
        if leaf.index not in free and not np.isclose(float(ours), float(theirs), rtol=1e-9, atol=0):
            raise UsageError(
                f"The rig gives {leaf.name} = {float(theirs):.9g}, but the oscillator has {float(ours):.9g}. Build it "
                "with rig.oscillator(friction)."
            )


def contradiction(oscillator: Oscillator, half_period: float) -> tuple[str, ...]:
    """Return a warning if the record's frequency contradicts the machine.

    Args:
        oscillator: the machine at its start values.
        half_period: half-period of the record [s].
    """
    # A unit mass or stiffness means that it is unknown.
    if 1.0 in (float(oscillator.mass), float(oscillator.stiffness)):
        return ()
    # Numpy-free host arithmetic: a JAX operation would compile a program in a first fit.
    machine = math.sqrt(float(oscillator.stiffness) / float(oscillator.mass)) / (2 * math.pi)
    record = 0.5 / half_period
    ratio = (record / machine) ** 2
    # A contact may be far stiffer than the spring; the mass then oscillates on it.
    rings = bool(oscillator.friction.n_states) and ratio > 1
    if rings or not machine > 0 or 1 / _CONTRADICTED < ratio < _CONTRADICTED:
        return ()
    power = math.log10(ratio)
    mistake = next((text for at, text in _MISTAKES.items() if abs(power - at) < 0.5), "Is one of them in another unit?")
    return (
        f"Stiffness and mass give a natural frequency of {machine:.4g} Hz, but the record oscillates at {record:.4g} "
        f"Hz: check stiffness and mass, from which damping and friction follow, and the unit of the time. {mistake}",
    )
