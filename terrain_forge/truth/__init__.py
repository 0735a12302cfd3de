"""The truth about a world, as files: rasters, tables, size-frequency verification."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
