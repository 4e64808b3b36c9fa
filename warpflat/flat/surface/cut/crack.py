"""A crack: what a cut leaves of the cloth along it."""

from __future__ import annotations

from dataclasses import dataclass

from warpflat.core.arrays import IntArray

__all__ = ["Crack"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Crack:
    """The two edges of cloth that one stretch of a cut leaves, matched vertex by vertex.

    Attributes:
        path: #P, vertices of the uncut mesh, in the direction in which the path was given.
        left: #P, the vertices of the cut mesh on the left of that direction, seen from outside.
        right: #P, those on the right. At the tip of a dart left and right are the same vertex.
    """

    path: IntArray
    left: IntArray
    right: IntArray
