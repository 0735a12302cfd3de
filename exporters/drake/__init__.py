"""Drake: an SDF that Drake's parser loads whole, whose ground collides as it is."""

from .export import export
from .load import check_capacity
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "check_capacity", "export", "opening"]
