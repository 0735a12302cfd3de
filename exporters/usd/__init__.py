"""OpenUSD with physics: a stage for Isaac Sim, Newton and every USD viewer."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
