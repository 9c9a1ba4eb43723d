"""Laws whose internal states follow differential equations."""

from fricjax.friction import LuGre, Tanh, Windage
from tests.cases.case import LawCase

BRISTLE = {
    "LuGre": LawCase(LuGre(0.1, sigma0=1e4, sigma1=50.0, sigma2=0.3), 0.2, 0.2),
    "LuGre static": LawCase(LuGre(0.1, 0.15, 5e-3, sigma0=1e4, sigma1=1e2, sigma2=60.0), 0.3, 0.2),
    "LuGre not passive": LawCase(LuGre(0.5, 0.75, 1e-3, sigma0=1e5, sigma1=316.2, sigma2=0.4), 1.5, 1.0, passive=False),
    "Sum smooth": LawCase(Tanh(0.1, 1e-3) + LuGre(0.1) + Windage(0.5), 0.2, 0.4),
}
