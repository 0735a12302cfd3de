"""Plain meshes: the world as PLY, STL or OBJ, for ray casters and for programs of any kind."""

from .export import check_capacity, export
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
