"""GLB: the world as one glTF 2.0 file for viewers, game engines and Blender."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
