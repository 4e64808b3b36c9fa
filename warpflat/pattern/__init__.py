"""Flat pieces on paper: drafting, drawings and files of patterns."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
