"""Learning to drive: an environment of Gymnasium, batched queries, ground for other engines."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
__getattr__("register_environments")()
