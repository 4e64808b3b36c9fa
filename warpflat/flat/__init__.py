"""The paper: from a surface to a flat layout, and its cuts."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
