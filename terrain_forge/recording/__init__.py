"""Recordings: what the sensors of a rover measure along a path, as a dataset on the disk."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
