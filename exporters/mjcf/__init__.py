"""MJCF: the world and the scene for MuJoCo, and for what else reads its XML."""

from .export import export
from .options import Options
from .room import require_room

__all__ = ["Options", "export", "require_room"]
