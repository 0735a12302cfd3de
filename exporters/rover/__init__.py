"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from .export import export, opening
from .options import Options
from .readback import CONSUMERS

__all__ = ["CONSUMERS", "Options", "export", "opening"]
