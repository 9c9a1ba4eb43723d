"""The rig without friction, and the losses that are not friction: damping and drag, calibrated or from a free decay."""

from typing import Any

from ..errors import UsageError
from ..fitting import fit
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..rig import Rig


def frictionless(rig: Rig, *, damping_known: bool = True) -> Oscillator:
    """The rig without friction: mass, restoring force, damping and drag.

    Args:
        rig: the rig.
        damping_known: whether its damping is needed as well.

    Raises:
        UsageError: no rig, or one without damping although its loss must be separated from that of friction.
    """
    if not isinstance(rig, Rig):
        raise UsageError(f"rig must be a fricjax.Rig, got {type(rig).__name__}. Read one with Rig.from_toml(path).")
    if damping_known and rig.damping is None and rig.damping_ratio is None:
        raise UsageError(
            "The rig has no damping, so that its viscous loss would count as friction. Give the rig its damping "
            "or damping_ratio (0 for none), or a no-contact run."
        )
    return rig.oscillator(Coulomb(0.0))


def with_losses(rig: Rig, no_contact: Any = None) -> Rig:
    """The rig with the losses that are not friction.

    Args:
        rig: mass, restoring force and load; without a `no_contact` run damping and drag as well.
        no_contact: a free decay without contact, passed as to :func:`fricjax.fit`, from which damping and drag are
            fitted; the stiffness, which the load on the springs may change, is fitted beside them but not taken over.

    Raises:
        UsageError: no rig, a rig without damping where no run is passed, or a `no_contact` that is no run.
        DataError: a run without contact that cannot be read.
        FitError: a run without contact that cannot be fitted.
    """
    oscillator = frictionless(rig, damping_known=no_contact is None)
    if no_contact is None:
        return rig
    values = fit(no_contact, oscillator, ["damping", "drag", "stiffness"]).values
    return rig.replace(damping=values["damping"], drag=values["drag"])
