"""OpenUSD with physics: a stage for Isaac Sim, Newton and every USD viewer."""

from .export import export
from .options import Options

__all__ = ["Options", "export"]
