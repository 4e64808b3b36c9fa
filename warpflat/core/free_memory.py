"""Freed memory is returned to the system here."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache

__all__ = ["return_freed_memory"]


def return_freed_memory() -> None:
    """Let glibc return freed memory to the system; with another C library nothing is done.

    Each thread has a heap of its own, whose holes no other fills: after a development beside its coarser levels a tenth to a fifth of
    what a relaxation takes would lie idle.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@cache
def _trim() -> Callable[[int], int] | None:
    if not sys.platform.startswith("linux"):
        return None
    trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
    return trim
