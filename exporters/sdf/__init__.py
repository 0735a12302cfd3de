"""Gazebo's SDF: a world of models that Gazebo Classic and the newer gz-sim load."""

from .export import export
from .losses import check_capacity
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
