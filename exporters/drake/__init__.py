"""Drake: an SDF that Drake's parser loads whole, whose ground collides as it is."""

from .export import export
from .load import require_room
from .options import Options

__all__ = ["Options", "export", "require_room"]
