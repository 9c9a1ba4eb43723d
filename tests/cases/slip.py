"""Laws of elements that stick and slip."""

from fricjax.friction import GeneralisedMaxwellSlip, Jenkins, Leuven, MaxwellSlip
from tests.cases.case import LawCase

STIFFNESSES, SHARES = (5e3, 3e3, 2e3), (0.2, 0.3)

SLIP = {
    "Jenkins": LawCase(Jenkins(0.1, 1e4), 0.2, 0.2),
    "MaxwellSlip": LawCase(MaxwellSlip(STIFFNESSES, (0.02, 0.03, 0.05)), 0.2, 0.2),
    "GMS": LawCase(GeneralisedMaxwellSlip(0.1, None, 1e-3, STIFFNESSES, SHARES, 50.0, 0.3), 0.2, 0.2),
    "GMS static": LawCase(GeneralisedMaxwellSlip(0.1, 0.15, 5e-3, STIFFNESSES, SHARES, 50.0), 0.3, 0.2),
    "Leuven": LawCase(Leuven(0.1, None, 1e-3, STIFFNESSES, SHARES, 2.0), 0.2, 0.2),
    "Leuven static": LawCase(Leuven(0.1, 0.15, 5e-3, STIFFNESSES, SHARES, 1.0, 10.0, 5.0), 0.3, 0.2),
}
