"""Laws with internal states that follow differential equations."""

from fricjax.friction import (
    BlimanSorine,
    BoucWen,
    Dahl,
    ElastoPlastic,
    LuGre,
    QuadraticDrag,
    RateState,
    RateStateSlip,
    Rolling,
    Tanh,
)
from tests.cases.case import LawCase

# Peak of the virgin curve of f1 = 0.3 N, f2 = 0.1 N, eta = 0.5: where f1 exp(-2 s) = 0.5 f2 exp(-s), s = ln 6.
_PEAK = 0.3 * (1 - 6.0**-2) - 0.1 * (1 - 1 / 6)

BRISTLE = {
    "LuGre": LawCase(LuGre(0.1, sigma0=1e4, sigma1=50.0, sigma2=0.3), 0.2, 0.2),
    "LuGre static": LawCase(LuGre(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=1e2, sigma2=60.0), 0.3, 0.2),
    "LuGre fading": LawCase(LuGre(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=1e2, v_damping=0.01), 0.3, 0.2),
    "LuGre not passive": LawCase(LuGre(0.5, 0.75, 1e-3, sigma0=1e5, sigma1=316.2, sigma2=0.4), 1.5, 1.0, passive=False),
    "Sum smooth": LawCase(Tanh(0.1, 1e-3) + LuGre(0.1) + QuadraticDrag(0.5), 0.2, 0.4),
    "Dahl": LawCase(Dahl(0.1, 1e4), 0.2, 0.2),
    "Dahl exponent": LawCase(Dahl(0.1, 1e4, 1.5), 0.2, 0.2),
    "BlimanSorine": LawCase(BlimanSorine(0.15, 0.05, 0.5, 2e-5), _PEAK, 0.2),
    "BlimanSorine first order": LawCase(BlimanSorine(0.1, 0.0, 0.5, 4e-5), 0.2, 0.2),
    "ElastoPlastic": LawCase(
        ElastoPlastic(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=1e2, sigma2=60.0, breakaway_fraction=0.3), 0.3, 0.2
    ),
    "BoucWen": LawCase(BoucWen(0.1, 1e4, 2.0, 0.7), 0.2, 0.2),
    "Rolling": LawCase(Rolling(0.1 * 2 ** (-1 / 3), 2e-5, 1 / 3), 0.2, 0.2),
    "RateState": LawCase(RateState(0.1, 0.01, 0.015, 1e-5), 0.2, 0.2, parity=1.0),
    "RateStateSlip": LawCase(RateStateSlip(0.1, 0.015, 0.01, 1e-5), 0.2, 0.2, parity=1.0),
}
