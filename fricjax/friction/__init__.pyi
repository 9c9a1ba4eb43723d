from .ageing import Ageing
from .base import AbstractFriction, Sum, scalar
from .bliman_sorine import BlimanSorine
from .bouc_wen import BoucWen
from .coefficient import Coefficient, fraction, not_negative, positive, within
from .coulomb import Coulomb
from .dahl import Dahl
from .elasto_plastic import ElastoPlastic
from .generalised_maxwell_slip import GeneralisedMaxwellSlip
from .kinds import AbstractBristle, AbstractSetValued, AbstractSmooth
from .leuven import Leuven
from .load_dependent import LoadDependent
from .lorentzian import Lorentzian
from .lugre import LuGre
from .makkar import Makkar
from .maxwell_slip import Jenkins, MaxwellSlip
from .quadratic_drag import QuadraticDrag
from .rate_state import RateState, RateStateSlip
from .rolling import Rolling
from .spline import MonotoneSpline, Spline
from .stribeck import Stribeck
from .tanh import Tanh
from .viscous import Viscous

__all__ = [
    "AbstractBristle",
    "AbstractFriction",
    "AbstractSetValued",
    "AbstractSmooth",
    "Ageing",
    "BlimanSorine",
    "BoucWen",
    "Coefficient",
    "Coulomb",
    "Dahl",
    "ElastoPlastic",
    "GeneralisedMaxwellSlip",
    "Jenkins",
    "Leuven",
    "LoadDependent",
    "Lorentzian",
    "LuGre",
    "Makkar",
    "MaxwellSlip",
    "MonotoneSpline",
    "QuadraticDrag",
    "RateState",
    "RateStateSlip",
    "Rolling",
    "Spline",
    "Stribeck",
    "Sum",
    "Tanh",
    "Viscous",
    "fraction",
    "not_negative",
    "positive",
    "scalar",
    "within",
]
