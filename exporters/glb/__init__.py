"""GLB: the world as one glTF 2.0 file for viewers, game engines and Blender."""

from .export import export, require_room
from .options import Options

__all__ = ["Options", "export", "require_room"]
