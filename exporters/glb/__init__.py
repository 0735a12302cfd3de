"""GLB: the world as one glTF 2.0 file for viewers, game engines and Blender."""

from .export import check_capacity, export
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
