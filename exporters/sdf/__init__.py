"""Gazebo's SDF: a world of models that Gazebo Classic and the newer gz-sim load."""

from .export import export
from .load import require_room
from .options import Options

__all__ = ["Options", "export", "require_room"]
