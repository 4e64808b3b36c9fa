"""The sides of a piece as the cut line sees them: edges with their strips of allowance, and darts that are folded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, turn_between, unit
from warpflat.pattern.drafting.polygons import GRID, difference, union

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = ["MITRE_REACH", "Side", "Wedge", "allowance_strip", "corner_fill", "outline_points"]


#: A mitre may run this many (wider) allowances past the corner; beyond it the corner is squared off.
MITRE_REACH = 1.75


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """One edge with its allowance.

    Attributes:
        name: the edge's.
        points: #P by 2 [m], counter-clockwise round the piece.
        width: allowance [m]; one below the grid's resolution counts as none.
        kind: as in `Edge`.
    """

    name: str
    points: FloatArray
    width: float
    kind: str

    @property
    def leaves(self) -> FloatArray:
        """Unit vector in which it leaves its first point."""
        return unit(self.points[1] - self.points[0])

    @property
    def arrives(self) -> FloatArray:
        """Unit vector in which it arrives at its last point."""
        return unit(self.points[-1] - self.points[-2])

    def __post_init__(self) -> None:
        if self.width < GRID:
            object.__setattr__(self, "width", 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wedge:
    """A dart that is folded, not cut away.

    Attributes:
        name: the dart's.
        left: #P by 2 [m], the leg from the border to the tip.
        right: #P by 2 [m], the leg from the tip to the border.
        fold_to: side to which the wedge is pressed, "left" or "right".
    """

    name: str
    left: FloatArray
    right: FloatArray
    fold_to: str

    @property
    def tip(self) -> FloatArray:
        return self.left[-1]

    @property
    def middle(self) -> FloatArray:
        """Unit vector from the tip along the line on which the wedge is folded."""
        return unit(unit(self.left[0] - self.tip) + unit(self.right[-1] - self.tip))

    @property
    def opening(self) -> float:
        """Angle [rad] between the legs at the tip."""
        return abs(turn_between(self.left[0] - self.tip, self.right[-1] - self.tip))


def outline_points(side: Side | Wedge) -> FloatArray:
    """Return the points of a side, #P by 2 [m], without its last one."""
    return np.concatenate([side.left[:-1], side.right[:-1]]) if isinstance(side, Wedge) else side.points[:-1]


def allowance_strip(side: Side, body: Polygon) -> Geometry:
    """Return the strip of cloth beside an edge, square at both ends, without what would fall on the piece."""
    import shapely

    if side.width <= 0:
        return shapely.Polygon()
    start, end = side.points[:-1], side.points[1:]
    direction = end - start
    length = np.linalg.norm(direction, axis=1)
    start, end, direction = start[length > 1e-9], end[length > 1e-9], direction[length > 1e-9]
    direction = direction / np.linalg.norm(direction, axis=1)[:, None]
    out = side.width * np.column_stack([direction[:, 1], -direction[:, 0]])
    quads = shapely.polygons(np.stack([start, end, end + out, start + out], axis=1))
    fills = [
        fill
        for corner, a, b in zip(end[:-1], direction[:-1], direction[1:], strict=True)
        if (fill := corner_fill(corner, a, b, side.width, side.width)) is not None
    ]
    strip = difference(union([*quads, *fills]), body)
    # The strip keeps its parts along its edge: a wide strip may pass through a narrow piece and come out again.
    parts = shapely.get_parts(strip)
    if len(parts) <= 1:
        return strip
    edge = shapely.LineString(side.points)
    kept = [part for part in parts if part.buffer(2 * GRID).intersection(edge).length > 1e-5]
    return union(kept)


def corner_fill(corner: FloatArray, a: FloatArray, b: FloatArray, width_a: float, width_b: float) -> Polygon | None:
    """Return the cloth between two strips at a corner, where the outline turns left; None where it does not.

    The outer lines of the strips run on until they meet. Where that is too far they are squared off. Where one strip is
    so much wider that its line would have to turn back, its square end stays and the narrow strip runs up against it.

    Args:
        corner: [m].
        a, b: unit vectors along the outline before and after the corner.
        width_a, width_b: allowances [m].
    """
    import shapely

    sine, cosine = float(a[0] * b[1] - a[1] * b[0]), float(a @ b)
    if turn_between(a, b) <= 1e-6 or max(width_a, width_b) <= 0:
        return None
    normal_a, normal_b = np.array([a[1], -a[0]]), np.array([b[1], -b[0]])
    end_a, end_b = corner + width_a * normal_a, corner + width_b * normal_b
    # At a spike (a half turn) both outer lines are parallel; any reach beyond the limit is squared off.
    sine = max(sine, 1e-9)
    reach_a, reach_b = (width_b - width_a * cosine) / sine, (width_a - width_b * cosine) / sine
    if reach_a < 0:
        ring = [corner, corner + width_b / cosine * normal_a, end_b]
    elif reach_b < 0:
        ring = [corner, end_a, corner + width_a / cosine * normal_b]
    else:
        limit = MITRE_REACH * max(width_a, width_b)
        ring = [corner, end_a, end_a + min(reach_a, limit) * a, end_b - min(reach_b, limit) * b, end_b]
    polygon = shapely.Polygon(ring)
    return polygon if polygon.is_valid else shapely.MultiPoint(ring).convex_hull
