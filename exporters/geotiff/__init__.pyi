"""GeoTIFF: the world as rasters, for geographic information systems and planners."""

from .joining import join_tiles as join_tiles
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .writing import Options as Options
from .writing import export as export
from .writing import export_tile as export_tile
