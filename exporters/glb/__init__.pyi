"""GLB: the world as one glTF 2.0 file for viewers, game engines and Blender."""

from .options import Options as Options
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .tiles import export_tile as export_tile
from .tiles import join_tiles as join_tiles
from .writing import check_capacity as check_capacity
from .writing import export as export
