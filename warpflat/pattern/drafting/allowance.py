"""The cut line: each edge's own allowance, corners mitred or squared, hems and darts shaped so that they fold flat.

The cut line is the border of a union of simple polygons: the piece, a strip beside every edge, a fill at every corner,
a cap over every dart. A union cannot cross itself, whatever the angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, InputError
from warpflat.pattern.drafting.dart_allowance import dart_allowance
from warpflat.pattern.drafting.hem_allowance import fold_hem
from warpflat.pattern.drafting.piece_parts import FOLD_STRAIGHT
from warpflat.pattern.drafting.polygons import (
    LOST,
    close_slits,
    half_plane,
    intersection,
    outer_ring,
    union,
)
from warpflat.pattern.drafting.sides import MITRE_REACH, Side, Wedge, allowance_strip, corner_fill, outline_points

if TYPE_CHECKING:
    from shapely import Geometry

__all__ = ["CutOutline", "cut_hole", "cut_outline"]


#: A bay of a hole's allowance narrower than this [m] is a slit, which nobody could cut or turn.
BAY = 2e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class CutOutline:
    """The line along which a piece is cut.

    Attributes:
        points: #P by 2 [m], counter-clockwise, closed; the first point is not repeated.
        notes: what the cutter should know of it.
        prolonged: by dart, the unit vectors in which its left and its right leg run on through the allowance.
    """

    points: FloatArray
    notes: tuple[str, ...]
    prolonged: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)


def cut_outline(sides: Sequence[Side | Wedge]) -> CutOutline:
    """Work out the line along which a piece is cut.

    Args:
        sides: the outline in order, counter-clockwise; a `Wedge` stands for the two legs of a folded dart.

    Returns:
        A simple closed line. It contains the outline; on the fold both coincide.

    Raises:
        InputError: the piece reaches farther across the line of its own fold than a fold may bend.
    """
    import shapely

    notes: list[str] = []
    body = shapely.Polygon(np.concatenate([outline_points(side) for side in sides]))
    parts: list[Geometry] = [body]
    strips = [allowance_strip(side, body) if isinstance(side, Side) else shapely.Polygon() for side in sides]
    prolonged: dict[str, tuple[FloatArray, FloatArray]] = {}
    count = len(sides)
    for index, side in enumerate(sides):
        before, after = (index - 1) % count, (index + 1) % count
        if isinstance(side, Wedge):
            prolonged[side.name], added, remarks = dart_allowance(sides, strips, index, before, after, body)
            parts += added
            notes += remarks
        elif (hem := fold_hem(sides, strips, index, after, body)) is not None:
            parts += hem
        elif isinstance(follows := sides[after], Side):
            fill = corner_fill(side.points[-1], side.arrives, follows.leaves, side.width, follows.width)
            parts += [] if fill is None else [fill]
    whole = close_slits(union([*parts, *strips]))
    for side in sides:
        if isinstance(side, Side) and side.kind == "fold":
            # Keep what lies on the piece's side of its fold.
            half = half_plane(side.points[0], side.points[-1], body.length + 2.0)
            over = float(shapely.distance(half, shapely.points(shapely.get_coordinates(body))).max())
            if over > FOLD_STRAIGHT:
                raise InputError(
                    f"edge {side.name!r} lies on the fold, but the piece reaches {over * 1e3:.1f} mm beyond it; "
                    "a half piece lies on one side of its fold"
                )
            whole = intersection(whole, half)
    polygon = max(shapely.get_parts(whole), key=lambda part: part.area)
    pockets = [shapely.Polygon(ring) for ring in polygon.interiors]
    if any(pocket.area > 1e-6 for pocket in pockets):
        notes.append("allowances on two sides of a narrow gap meet and close it: make them narrower there")
    points = outer_ring(shapely.simplify(shapely.Polygon(polygon.exterior), 2e-6))
    return CutOutline(points=points, notes=tuple(notes), prolonged=prolonged)


def cut_hole(ring: FloatArray, width: float) -> FloatArray | None:
    """Work out the line along which a hole is cut, inwards of its sewing line by the allowance.

    Args:
        ring: #P by 2 [m], the sewing line, closed, the first point not repeated.
        width: allowance [m].

    Returns:
        #Q by 2 [m], counter-clockwise, closed, the first point not repeated; None where the hole is too small or too
        narrow.
    """
    import shapely

    if width <= 0:
        return ring
    inner = shapely.Polygon(ring).buffer(0).buffer(-width, join_style="mitre", mitre_limit=MITRE_REACH)
    wide = inner.buffer(-BAY / 2, join_style="mitre").buffer(BAY / 2, join_style="mitre")
    inner = intersection(inner, wide)
    if inner.geom_type != "Polygon" or inner.area <= LOST:
        return None
    return outer_ring(shapely.simplify(inner, 2e-6))
