"""Gazebo's SDF: a world of models that Gazebo Classic and the newer gz-sim load."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
