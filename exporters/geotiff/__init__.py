"""GeoTIFF: the world as rasters, for geographic information systems and planners."""

from .export import Options, export
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "export", "opening"]
