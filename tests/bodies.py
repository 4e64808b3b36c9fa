"""Bodies of a size, each built once in a process; nobody changes one."""

from __future__ import annotations

import functools

from warpflat.mannequin.mannequin import Mannequin

__all__ = ["body_of_size"]


@functools.cache
def body_of_size(resolution_mm: float, size: str = "EU 38") -> Mannequin:
    """The mannequin of a size, with edges about so long."""
    return Mannequin.from_size(size, resolution_mm=resolution_mm)
