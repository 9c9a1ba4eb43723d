from .decay import Decay, Quality, Start, decay
from .forces import Forces, Tabulation, tabulate
from .mesh import Layout, Mesh, choose_layout, make_mesh
from .solve import Size, error, padded, solve

__all__ = [
    "Decay",
    "Forces",
    "Layout",
    "Mesh",
    "Quality",
    "Size",
    "Start",
    "Tabulation",
    "choose_layout",
    "decay",
    "error",
    "make_mesh",
    "padded",
    "solve",
    "tabulate",
]
