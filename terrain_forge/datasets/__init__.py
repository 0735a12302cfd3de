"""Recorded datasets: reading the master recording, and writing other formats from it."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
