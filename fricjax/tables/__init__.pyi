from .decay import Decay, Quality, Reversals, decay, reversals
from .forces import Forces, Tabulation, tabulate
from .layout import Layout, choose_layout
from .mesh import Mesh, make_mesh
from .nodes import Start
from .solve import Size, error, padded, solve

__all__ = [
    "Decay",
    "Forces",
    "Layout",
    "Mesh",
    "Quality",
    "Reversals",
    "Size",
    "Start",
    "Tabulation",
    "choose_layout",
    "decay",
    "error",
    "make_mesh",
    "padded",
    "reversals",
    "solve",
    "tabulate",
]
