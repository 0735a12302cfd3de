"""What a person meets on a terminal: lines, progress, statuses, what is installed, completion."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
