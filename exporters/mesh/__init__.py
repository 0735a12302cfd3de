"""Plain meshes: the world as PLY, STL or OBJ, for ray casters and for programs of any kind."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
