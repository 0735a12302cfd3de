"""What the stages hand to each other: bodies, sites, ground, rocks, rovers, paths, worlds."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
