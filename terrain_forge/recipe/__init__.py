"""The recipe: its schema, reading it, its input files and its limits."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
