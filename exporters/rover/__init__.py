"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
