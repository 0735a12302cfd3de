"""GeoTIFF: the world as rasters, for geographic information systems and planners."""

from .export import export
from .options import Options

__all__ = ["Options", "export"]
