"""MJCF: the world and the scene for MuJoCo, and for what else reads its XML."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
