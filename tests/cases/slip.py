"""Laws of elements that stick and slip."""

from fricjax.friction import Jenkins, MaxwellSlip
from tests.cases.case import LawCase

SLIP = {
    "Jenkins": LawCase(Jenkins(0.1, 1e4), 0.2, 0.2),
    "MaxwellSlip": LawCase(MaxwellSlip((5e3, 3e3, 2e3), (0.02, 0.03, 0.05)), 0.2, 0.2),
}
