"""Many worlds of one recipe: what is drawn for each, how hard it is, and making them all."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
