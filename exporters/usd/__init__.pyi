"""OpenUSD with physics: a stage for Isaac Sim, Newton and every USD viewer."""

from .options import Options as Options
from .options import prepare as prepare
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .tiles import begin_tiles as begin_tiles
from .tiles import export_tile as export_tile
from .tiles import join_tiles as join_tiles
from .writing import export as export
