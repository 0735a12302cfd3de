"""Where the Sun shines and the Earth is seen: horizons, shadows, hours of light over a period."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
