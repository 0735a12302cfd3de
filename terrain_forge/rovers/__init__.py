"""Rovers: those of ours, and the user's from URDF, xacro or MJCF."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
