"""Drake: an SDF that Drake's parser loads whole, whose ground collides as it is."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
