"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from .export import export, opening
from .options import Options

__all__ = ["Options", "export", "opening"]
