"""How well systems localised: trajectories against the truth, as the paper does and others."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
