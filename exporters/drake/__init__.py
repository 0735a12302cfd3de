"""Drake: an SDF that Drake's parser loads whole, whose ground collides as it is."""

from .export import export
from .options import Options, check_capacity
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
