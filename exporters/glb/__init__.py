"""GLB: the world as one glTF 2.0 file for viewers, game engines and Blender."""

from .export import check_capacity, export
from .options import Options

__all__ = ["Options", "check_capacity", "export"]
