"""Plain meshes: the world as OBJ, STL or PLY, for ray casters and for programs of any kind."""

from .export import export, require_room
from .options import Options

__all__ = ["Options", "export", "require_room"]
