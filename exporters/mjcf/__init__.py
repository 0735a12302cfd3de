"""MJCF: the world and the scene for MuJoCo, and for what else reads its XML."""

from .export import export
from .losses import check_capacity
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
