"""The cut line: each edge's own allowance, corners mitred or squared, hems and darts shaped so that they fold flat.

The cut line is the border of a union of simple polygons: the piece, a strip beside every edge, a fill at every corner,
a cap over every dart. A union cannot cross itself, whatever the angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import points_at_lengths, polyline_length
from warpflat.pattern.pieces import FOLD_STRAIGHT

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = ["CutOutline", "Side", "Wedge", "cut_hole", "cut_outline"]


#: Precision [m] to which the union is snapped, far below what any cutter resolves.
GRID = 1e-7
#: Slits and spikes narrower than twice this [m] are rounding, not shape.
CLOSE = 2e-6
#: Closing them changes the area by less than this [m2].
LOST = 1e-5
#: What a hole's allowance leaves of a bay narrower than this [m] is a slit, which nobody could cut, nor turn.
BAY = 2e-3
#: A mitre may run this many (wider) allowances past the corner; beyond it the corner is squared off.
MITRE_REACH = 1.75
#: A hem folds up along itself; its ends mirror the side seams if these meet it at 90 degrees, give or take this [rad].
HEM_SLANT = np.radians(40.0)
#: The fold of a dart that meets the border at a slant reaches past the mouth to be caught there, up to this many legs.
WEDGE_REACH = 2.0
#: A dart that opens wider than this [rad] cannot be pressed to one side: it is cut out with allowances on its legs.
WIDEST_DART = np.radians(90.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """One edge as the cut line sees it: `points` #P by 2 [m] counter-clockwise, `width` [m], `kind` as in `Edge`.

    A width that the grid does not resolve is none.
    """

    name: str
    points: FloatArray
    width: float
    kind: str

    def __post_init__(self) -> None:
        if self.width < GRID:
            object.__setattr__(self, "width", 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wedge:
    """A dart that is folded, not cut: its legs (both #P by 2 [m], left from the border, right to the border)."""

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
        both = _unit(self.left[0] - self.tip) + _unit(self.right[-1] - self.tip)
        return _unit(both)

    @property
    def opening(self) -> float:
        """Angle [rad] between the legs at the tip."""
        a, b = _unit(self.left[0] - self.tip), _unit(self.right[-1] - self.tip)
        return float(np.arctan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b))


@dataclass(frozen=True, kw_only=True, eq=False)
class CutOutline:
    """The cut line, #P by 2 [m] counter-clockwise and closed (first point not repeated), and what is odd about it.

    `prolonged` has, by dart, the unit vectors in which its left and its right leg run on through the allowance.
    """

    points: FloatArray
    notes: tuple[str, ...]
    prolonged: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)


def cut_outline(sides: Sequence[Side | Wedge]) -> CutOutline:
    """The line along which a piece is cut.

    Args:
        sides: the outline in order, counter-clockwise; a `Wedge` stands for the two legs of a folded dart.

    Returns:
        A simple closed line. It contains the outline; on the fold both coincide.

    Raises:
        InputError: if the piece reaches farther across the line of its own fold than a fold may bend.
    """
    import shapely

    notes: list[str] = []
    body = shapely.Polygon(np.concatenate([_leading(side) for side in sides]))
    parts: list[Geometry] = [body]
    strips = [_strip(side, body) if isinstance(side, Side) else shapely.Polygon() for side in sides]
    prolonged: dict[str, tuple[FloatArray, FloatArray]] = {}
    count = len(sides)
    for index, side in enumerate(sides):
        before, after = (index - 1) % count, (index + 1) % count
        if isinstance(side, Wedge):
            prolonged[side.name], own, told = _dart_parts(sides, strips, index, before, after, body)
            parts += own
            notes += told
        else:
            parts += _corner_parts(sides, strips, index, after, body)
    whole = _union([*parts, *strips])
    whole = _closed(whole)
    for side in sides:
        if isinstance(side, Side) and side.kind == "fold":
            half = _half_plane(side.points[0], side.points[-1], body)
            over = float(shapely.distance(half, shapely.points(shapely.get_coordinates(body))).max())
            if over > FOLD_STRAIGHT:
                raise InputError(
                    f"edge {side.name!r} lies on the fold, but the piece reaches {over * 1e3:.1f} mm beyond it; "
                    "a half piece lies on one side of its fold"
                )
            whole = _common(whole, half)
    polygon = max(shapely.get_parts(whole), key=lambda part: part.area)
    pockets = [shapely.Polygon(ring) for ring in polygon.interiors]
    if any(pocket.area > 1e-6 for pocket in pockets):
        notes.append("allowances on two sides of a narrow gap meet and close it: make them narrower there")
    ring = shapely.simplify(shapely.Polygon(polygon.exterior), 2e-6)
    points = np.asarray(shapely.orient_polygons(ring).exterior.coords)[:-1]
    return CutOutline(points=points, notes=tuple(notes), prolonged=prolonged)


def cut_hole(ring: FloatArray, width: float) -> FloatArray | None:
    """The line along which a hole is cut, its allowance inwards of the sewing line.

    Args:
        ring: #P by 2 [m], the sewing line, closed, the first point not repeated.
        width: of the allowance [m].

    Returns:
        #Q by 2 [m], counter-clockwise, closed likewise; None where the hole is too small or too narrow for one.
    """
    import shapely

    if width <= 0:
        return ring
    inner = shapely.Polygon(ring).buffer(0).buffer(-width, join_style="mitre", mitre_limit=MITRE_REACH)
    wide = inner.buffer(-BAY / 2, join_style="mitre").buffer(BAY / 2, join_style="mitre")
    inner = _common(inner, wide)
    if inner.geom_type != "Polygon" or inner.area <= LOST:
        return None
    return np.asarray(shapely.orient_polygons(shapely.simplify(inner, 2e-6)).exterior.coords)[:-1]


def _leading(side: Side | Wedge) -> FloatArray:
    """Points of the outline without the last one."""
    return np.concatenate([side.left[:-1], side.right[:-1]]) if isinstance(side, Wedge) else side.points[:-1]


def _strip(side: Side, body: Polygon) -> Geometry:
    """The cloth beside an edge, square at both ends, without what would fall on the piece or beyond it."""
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
        if (fill := _corner_fill(corner, a, b, side.width, side.width)) is not None
    ]
    strip = _minus(_union([*quads, *fills]), body)
    return _touching(strip, side.points)


def _union(parts: Sequence[Geometry]) -> Geometry:
    """The union of polygons, snapped to the grid: slivers of rounding between touching parts close."""
    import shapely

    return _areas(shapely.union_all([shapely.set_precision(part, GRID) for part in parts], grid_size=GRID))


def _closed(area: Geometry) -> Geometry:
    """Without the slits and spikes of rounding that parts leave where they meet along a slanted line (a dart's fold)."""
    # With long mitres GEOS now and then loses a whole polygon; what it gives is believed only if it is as large.
    for limit in (200.0, 20.0, 5.0):
        closed = area
        for distance in (CLOSE, -2 * CLOSE, CLOSE):
            closed = closed.buffer(distance, join_style="mitre", mitre_limit=limit)
        if abs(closed.area - area.area) < LOST:
            return closed
    return area


def _minus(area: Geometry, other: Geometry) -> Geometry:
    return _areas(area.difference(other, grid_size=GRID))


def _common(area: Geometry, other: Geometry) -> Geometry:
    return _areas(area.intersection(other, grid_size=GRID))


def _areas(geometry: Geometry) -> Geometry:
    """Without the points and lines in which polygons may touch."""
    import shapely

    if geometry.geom_type in ("Polygon", "MultiPolygon"):
        return geometry
    return shapely.MultiPolygon([p for p in shapely.get_parts(geometry) if p.geom_type == "Polygon"])


def _touching(strip: Geometry, line: FloatArray) -> Geometry:
    """The parts of a strip that lie along its edge: a wide strip may pass through a narrow piece and come out again."""
    import shapely

    parts = shapely.get_parts(strip)
    if len(parts) <= 1:
        return strip
    edge = shapely.LineString(line)
    kept = [part for part in parts if part.buffer(2 * GRID).intersection(edge).length > 1e-5]
    return _union(kept)


def _corner_fill(corner: FloatArray, a: FloatArray, b: FloatArray, width_a: float, width_b: float) -> Polygon | None:
    """The cloth between two strips where the outline turns left from direction `a` to `b` (unit vectors).

    The outer lines of the strips run on until they meet. Where that is too far they are squared off; where a strip is
    so much wider that its line would have to turn back, its square end stays and the narrow one runs up against it.
    """
    import shapely

    sine, cosine = float(a[0] * b[1] - a[1] * b[0]), float(a @ b)
    turn = np.arctan2(sine, cosine)
    if turn <= 1e-6 or max(width_a, width_b) <= 0:
        return None
    normal_a, normal_b = np.array([a[1], -a[0]]), np.array([b[1], -b[0]])
    end_a, end_b = corner + width_a * normal_a, corner + width_b * normal_b
    # At a spike (a half turn) both outer lines are parallel; any reach beyond the limit is squared off alike.
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


def _corner_parts(
    sides: Sequence[Side | Wedge], strips: list[Geometry], index: int, after: int, body: Polygon
) -> list[Geometry]:
    """What is added where two edges meet; a hem's strip is trimmed in place."""
    side, follows = sides[index], sides[after]
    if not isinstance(side, Side) or not isinstance(follows, Side):
        return []
    a, b = _unit(side.points[-1] - side.points[-2]), _unit(follows.points[1] - follows.points[0])
    corner = side.points[-1]
    turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
    if abs(turn - np.pi / 2) < HEM_SLANT and {side.kind, follows.kind} == {"hem", "seam"}:
        if side.kind == "hem":
            hem, inwards, seam, beyond = index, -a, after, -b
            width, hem_width = follows.width, side.width
        else:
            hem, inwards, seam, beyond = after, b, index, a
            width, hem_width = side.width, follows.width
        # Beside a seam that is shorter than the hem is deep there is nothing to mirror.
        beside = (follows if hem == index else side).points
        room = polyline_length(beside)
        if width > 0 and 0 < hem_width <= room:
            far = index - 1 if hem == index else (after + 1) % len(sides)
            return _folded_hem(
                corner, inwards, beyond, hem, seam, width, hem_width, strips, body, _cloth(sides, strips, far)
            )
    fill = _corner_fill(corner, a, b, side.width, follows.width)
    return [] if fill is None else [fill]


def _cloth(sides: Sequence[Side | Wedge], strips: Sequence[Geometry], index: int) -> Geometry:
    """What lies outside the outline there: an edge's strip, or a dart's wedge."""
    import shapely

    side = sides[index]
    return (
        strips[index]
        if isinstance(side, Side)
        else shapely.Polygon(np.concatenate([side.left, side.right[1:]])).buffer(0)
    )


def _folded_hem(
    corner: FloatArray,
    inwards: FloatArray,
    beyond: FloatArray,
    hem: int,
    seam: int,
    width: float,
    hem_width: float,
    strips: list[Geometry],
    body: Polygon,
    far: Geometry,
) -> list[Geometry]:
    """The end of a hem, mirrored on the hem line, so that turned up it covers the seam allowance exactly.

    `inwards` runs from the corner along the hem, `beyond` from the corner along the seam, away from the piece; `far` is
    the cloth beside the edge at the hem's other end, which a short hem is turned up on, too.
    """
    down = np.array([inwards[1], -inwards[0]])
    down = down if down @ beyond > 0 else -down
    out = np.array([beyond[1], -beyond[0]])
    out = out if out @ inwards < 0 else -out
    reach = hem_width + MITRE_REACH * width
    run_on = _box(corner, beyond, (0, reach), out, (0, width))
    run_on = _common(run_on, _box(corner, inwards, (-3 * reach, reach), -down, (0, 3 * reach)))
    strips[seam] = _without_beyond(strips[seam], corner, inwards, down, 3 * width)
    worn = _union([body, strips[seam], run_on, far])
    # A slightly curved hem leaves the mirror line; the first millimetres below it are hem in any case.
    core = _common(_box(corner, inwards, (0, reach), down, (0, 0.003)), strips[hem])
    turned = _union([_reflect(worn, corner, inwards), core])
    end = _box(corner, inwards, (-reach, hem_width), down, (0, 2 * hem_width))
    # Along the hem its own strip says how deep it is, curved or not; only what reaches past the corner is added.
    strips[hem] = _minus(strips[hem], _minus(end, turned))
    past = _common(turned, _box(corner, inwards, (-reach, 1e-5), down, (0, hem_width)))
    return [run_on, past]


def _dart_parts(
    sides: Sequence[Side | Wedge], strips: list[Geometry], index: int, before: int, after: int, body: Polygon
) -> tuple[tuple[FloatArray, FloatArray], list[Geometry], list[str]]:
    """How the legs run on, and the cap over a dart: the neighbour's cut line mirrored on the leg, then on the fold.

    So it folds flat. A note says where the cap would have to reach too far for that.
    """
    wedge, left, right = sides[index], sides[before], sides[after]
    if not isinstance(wedge, Wedge) or not isinstance(left, Side) or not isinstance(right, Side):
        raise InputError("two darts meet in one point of the border: leave an edge between them")
    mouth_left, mouth_right = wedge.left[0], wedge.right[-1]
    on_left, on_right = _prolonged(wedge, left, right)
    along_left, along_right = _unit(left.points[-1] - left.points[-2]), -_unit(right.points[1] - right.points[0])
    strips[before], end_left = _at_leg(strips[before], left.width, mouth_left, on_left, along_left, mouth_right)
    strips[after], end_right = _at_leg(strips[after], right.width, mouth_right, on_right, along_right, mouth_left)
    # A curved leg leaves its chord, on which the wedge is folded.
    lobes = [_lobes(wedge.left), _lobes(wedge.right)]
    if wedge.fold_to == "left":
        covered, mouth, beyond = _union([body, strips[before], end_left, lobes[0]]), mouth_left, on_left
    else:
        covered, mouth, beyond = _union([body, strips[after], end_right, lobes[1]]), mouth_right, on_right
    leg = max(float(np.linalg.norm(mouth_left - wedge.tip)), float(np.linalg.norm(mouth_right - wedge.tip)))
    spare = 4 * max(left.width, right.width)
    notes: list[str] = []
    cap, whole = _cap(wedge, body, covered, mouth, beyond, WEDGE_REACH * leg + spare)
    if not whole:
        cap, _ = _cap(wedge, body, covered, mouth, beyond, leg + spare)
        notes.append(
            f"dart {wedge.name} meets the border at so low an angle that its wedge is not caught in the seam: "
            "turn the dart, or open it less"
        )
    return (on_left, on_right), [end_left, end_right, *lobes, cap, _reflect(cap, wedge.tip, wedge.middle)], notes


def _prolonged(wedge: Wedge, left: Side, right: Side) -> tuple[FloatArray, FloatArray]:
    """Unit vectors in which the legs run on through the allowance: straight, but bent at a hem so that it folds up flat.

    What is turned up is then as long, from side to side, as what it lies on. Both legs bend alike, so that the wedge can
    be folded on its middle.
    """
    to_left, to_right = _unit(wedge.left[0] - wedge.tip), _unit(wedge.right[-1] - wedge.tip)
    if not left.kind == right.kind == "hem":
        return to_left, to_right
    depth = max(left.width, right.width)
    hem_left, hem_right = _secant(left.points[::-1], depth), _secant(right.points, depth)
    above = _between(hem_left, _secant(wedge.left, depth)) + _between(hem_right, _secant(wedge.right[::-1], depth))
    bend = (_between(hem_left, to_left) + _between(hem_right, to_right) - above) / 2
    if abs(bend) > HEM_SLANT:
        return to_left, to_right
    return _turned(to_left, -bend), _turned(to_right, bend)


def _cap(
    wedge: Wedge, body: Polygon, covered: Geometry, mouth: FloatArray, beyond: FloatArray, radius: float
) -> tuple[Geometry, bool]:
    """Half a dart's wedge: what it covers, mirrored on the leg at `mouth` and, past it, on its course `beyond`.

    No farther than `radius` [m] from the tip; False where that cuts it off.
    """
    import shapely

    tip, near = wedge.tip, _unit(mouth - wedge.tip)
    ends = [tip + radius * near, tip + radius * wedge.middle]
    half: Geometry = shapely.Polygon([tip, *ends])
    outwards = np.array([-near[1], near[0]])
    outwards = outwards if outwards @ wedge.middle < 0 else -outwards
    if beyond @ outwards > 0:
        half = _union([half, shapely.Polygon([mouth, mouth + radius * near, mouth + radius * beyond])])
    elif beyond @ outwards < 0:
        half = _without_beyond(half, mouth, beyond, outwards, radius)
    turned = _union([_reflect(covered, mouth, beyond), _reflect(body, mouth, near)])
    cap = _common(turned, half)
    cap = _union([part for part in shapely.get_parts(cap) if part.distance(shapely.Point((mouth + tip) / 2)) < 1e-6])
    return cap, cap.distance(shapely.LineString(ends)) > GRID


def _lobes(leg: FloatArray) -> Geometry:
    """What lies between a leg and its chord, on either side."""
    import shapely

    if len(leg) < 3:
        return shapely.Polygon()
    # Rounded first: where a leg touches its chord, its lobes would else cross by the last bit.
    noded = shapely.union_all([shapely.LinearRing(leg)], grid_size=GRID)
    return _areas(shapely.union_all(shapely.get_parts(shapely.polygonize([noded])), grid_size=GRID))


def _at_leg(
    strip: Geometry, width: float, mouth: FloatArray, leg: FloatArray, along: FloatArray, other_mouth: FloatArray
) -> tuple[Geometry, Geometry]:
    """A strip that ends on the prolonged leg of a dart: what is trimmed, and what is added.

    `along` is the unit direction in which the edge runs into the mouth of the dart.
    """
    import shapely

    if width <= 0:
        return strip, shapely.Polygon()
    inwards = np.array([-leg[1], leg[0]])
    inwards = inwards if inwards @ (other_mouth - mouth) > 0 else -inwards
    trimmed = _without_beyond(strip, mouth, leg, inwards, 3 * width)
    out = np.array([along[1], -along[0]])
    out = out if out @ leg > 0 else -out
    run_on = _box(mouth, along, (0, MITRE_REACH * width), out, (0, width))
    return trimmed, _without_beyond(run_on, mouth, leg, inwards, 3 * width)


def _without_beyond(
    area: Geometry, point: FloatArray, direction: FloatArray, side: FloatArray, radius: float
) -> Geometry:
    """`area` without what lies within `radius` of `point` on the `side` of the line through it along `direction`."""
    return _minus(area, _box(point, direction, (-radius, radius), side, (0, radius)))


def _box(
    point: FloatArray, along: FloatArray, reach: tuple[float, float], side: FloatArray, depth: tuple[float, float]
) -> Polygon:
    """The parallelogram from `point` over `reach` [m] along one unit vector and over `depth` [m] along another."""
    import shapely

    corners = [(reach[0], depth[0]), (reach[1], depth[0]), (reach[1], depth[1]), (reach[0], depth[1])]
    return shapely.Polygon([point + a * along + d * side for a, d in corners])


def _reflect(area: Geometry, point: FloatArray, direction: FloatArray) -> Geometry:
    """Mirror image on the line through `point` along the unit vector `direction`."""
    import shapely
    from shapely.affinity import affine_transform

    x, y = float(direction[0]), float(direction[1])
    matrix = np.array([[2 * x * x - 1, 2 * x * y], [2 * x * y, 2 * y * y - 1]])
    shift = point - matrix @ point
    return shapely.set_precision(affine_transform(area, [*matrix.reshape(-1).tolist(), *shift.tolist()]), GRID)


def _half_plane(start: FloatArray, end: FloatArray, body: Polygon) -> Polygon:
    """The side of the fold on which the piece lies, large enough for the piece and its allowances."""
    import shapely

    direction = _unit(end - start)
    inwards = np.array([-direction[1], direction[0]])
    x0, y0, x1, y1 = body.bounds
    size = 2 * (x1 - x0 + y1 - y0) + 2.0
    a, b = start - size * direction, start + size * direction
    return shapely.Polygon([a, b, b + size * inwards, a + size * inwards])


def _secant(line: FloatArray, length: float) -> FloatArray:
    """Unit vector from a line's first point to that at `length` [m] along it, or its last."""
    return _unit(points_at_lengths(line, length) - line[0])


def _between(a: FloatArray, b: FloatArray) -> float:
    """Angle [rad] between two unit vectors."""
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def _turned(vector: FloatArray, angle: float) -> FloatArray:
    """Counter-clockwise by `angle` [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]])


def _unit(vector: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-12 else np.array([1.0, 0.0])
