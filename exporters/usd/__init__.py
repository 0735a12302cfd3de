"""OpenUSD with physics: a stage for Isaac Sim, Newton and every USD viewer."""

from .export import export
from .options import Options
from .readback import CONSUMERS, opening

__all__ = ["CONSUMERS", "Options", "export", "opening"]
