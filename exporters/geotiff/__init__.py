"""GeoTIFF: the world as rasters, for geographic information systems and planners."""

from .export import export
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "export", "opening"]
