"""Memory that is freed, but not yet back with the system."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache

from warpflat.surface.mesh import Surface

__all__ = ["give_back", "give_back_of", "is_large"]

# On the way to the relaxation of more triangles so much is freed that giving it back is worth a twentieth of the time.
_MUCH_IS_FREED = 50_000


def is_large(surface: Surface) -> bool:
    """Whether what is worked out on the way to a piece's relaxation is worth to be let go of."""
    return len(surface.vertices) > _MUCH_IS_FREED


def give_back_of(surface: Surface) -> None:
    """Give back what a part of the way to its relaxation has freed, where that is much: of many triangles."""
    if is_large(surface) and not surface.is_quad.all():
        give_back()


def give_back() -> None:
    """Let the C library return what was freed; where it is not glibc's, nothing is done.

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
