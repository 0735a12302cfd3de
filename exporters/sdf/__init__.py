"""Gazebo's SDF: a world of models that Gazebo Classic and the newer gz-sim load."""

from .export import export
from .load import check_capacity
from .options import Options

__all__ = ["Options", "check_capacity", "export"]
