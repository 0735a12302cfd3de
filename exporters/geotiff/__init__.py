"""GeoTIFF: the world as rasters, for geographic information systems and planners."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
