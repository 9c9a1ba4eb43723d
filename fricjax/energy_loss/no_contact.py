"""What is lost without friction: damping and windage, from the rig's calibration or from a run without contact."""

from typing import Any

from ..fitting import fit
from ..oscillator import Oscillator
from ..rig import Rig
from .decay import machine


def contactless(rig: Rig, no_contact: Any = None) -> Oscillator:
    """The rig without friction, with the losses that are not friction; as :func:`with_losses` finds them."""
    return machine(with_losses(rig, no_contact))


def with_losses(rig: Rig, no_contact: Any = None) -> Rig:
    """The rig with the losses that are not friction.

    Args:
        rig: mass, restoring force and load; without a `no_contact` run damping and drag as well.
        no_contact: a free decay without contact, given as to :func:`fricjax.fit`, from which damping and drag are
            fitted; the stiffness, which the load on the springs may change, is fitted beside them but not taken over.

    Raises:
        UsageError: no rig, a rig without damping where no run is given, or a `no_contact` that is no run.
        DataError: a run without contact that cannot be read.
        FitError: a run without contact that cannot be fitted.
    """
    oscillator = machine(rig, damping_known=no_contact is None)
    if no_contact is None:
        return rig
    found = fit(no_contact, oscillator, ["damping", "drag", "stiffness"]).values
    return rig.replace(damping=found["damping"], drag=found["drag"])
