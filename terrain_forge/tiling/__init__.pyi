"""Sites in tiles: planned once, built tile by tile, brought together, cut, checked."""

from .building import STAGES as STAGES
from .building import TiledResult as TiledResult
from .building import build_tiles as build_tiles
from .building import progress_figures as progress_figures
from .checking import VALIDATE_STAGES as VALIDATE_STAGES
from .checking import validate_site as validate_site
from .cutting import cut_world as cut_world
from .joining import begin_site as begin_site
from .making import make_tile as make_tile
from .order import is_site as is_site
from .order import load_order as load_order
from .order import order_tiles as order_tiles
from .order import require_large_tiles as require_large_tiles
from .order import require_tiles as require_tiles
from .order import require_whole as require_whole
from .order import save_order as save_order
