"""OpenUSD with physics: a stage for Isaac Sim, Newton and every USD viewer."""

from .options import Options as Options
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .writing import export as export
