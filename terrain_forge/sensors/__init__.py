"""What a rover sees and feels: its motion, and instruments that measure it."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
