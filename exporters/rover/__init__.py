"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from .export import export
from .options import Options
from .usage import opening

__all__ = ["Options", "export", "opening"]
