"""Where Sun and Earth stand by date, and what the sky looks like."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
