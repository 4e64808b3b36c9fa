"""What a person starts: scenes, the command line, batches, the studio, pages to review."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
