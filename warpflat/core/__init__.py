"""Launching kernels, errors, files and text: what every other room uses, and what knows no mesh."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
