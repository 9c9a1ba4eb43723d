from .decay import Decay, Quality, Start, decay
from .forces import Forces, Tabulation, tabulate
from .mesh import Mesh, make_mesh
from .solve import error, is_resolved, solve

__all__ = [
    "Decay",
    "Forces",
    "Mesh",
    "Quality",
    "Start",
    "Tabulation",
    "decay",
    "error",
    "is_resolved",
    "make_mesh",
    "solve",
    "tabulate",
]
