"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from .export import export
from .options import Options
from .readback import CONSUMERS
from .usage import opening

__all__ = ["CONSUMERS", "Options", "export", "opening"]
