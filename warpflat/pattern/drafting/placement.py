"""Places for labels: beside lines and points so that no two overlap, and in the widest room of a piece or beside it.

Every picture and every pattern file takes the places of its words from here. Lengths are in one unit throughout: metres
of a pattern, inches of a picture's page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, tee
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, points_at_lengths, polyline_length, unit
from warpflat.pattern.drafting.drafted import DraftedPiece
from warpflat.pattern.drafting.label import LEADING, TEXT, TITLE, Label, box_around, label_lines, text_width, wrap_text
from warpflat.pattern.drafting.polygons import rotation
from warpflat.pattern.drafting.words import as_sentence, translate

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = [
    "LabelRoom",
    "Spot",
    "as_read",
    "default_grain",
    "fit_label",
    "in_batches",
    "leader_line",
    "place_label",
    "placed_points",
    "space_out",
    "spots_along",
    "spots_beside",
    "spots_beyond_ends",
]

# From the end of a picture's leader to its text [in].
_GAP = 0.04
# So much of a leader [in], from the line where it begins, may lie on what is taken.
_AT_LINE = 0.09
# Lines this steep, or steeper, are read upwards: the part of their direction that goes to the right.
_STEEP = 0.2

#: Distances [m] of labels from the sewing line and holes, from other lines, and from a fold, whose bracket and arrows
#: are 16 mm wide; the second row holds where there is little room.
CLEARANCES = ((0.004, 0.006, 0.022), (0.0015, 0.0025, 0.0165))
#: Smallest share of its full size at which a label stands on its piece, not beside it; below the second share it may
#: come nearer to lines.
LEAST, ENOUGH = 0.3, 0.6
#: A label beside its piece: its size, its greatest width [m], its distance from the piece [m], and how far [m] its
#: leader reaches into the cloth.
BESIDE_SIZE, BESIDE_WIDTH, BESIDE_GAP, LEADER = 0.6, 0.075, 0.010, 0.005
#: Room is sought by ellipses of these ratios of height to width: labels are wide, wrapped ones less so.
ELLIPSES = (0.4, 0.15, 1.0)
#: Factor by which a label must get larger to be turned, to have one more line break, to have a name as small as the
#: rest.
TURNED, BROKEN, SMALL_TITLE = 1.25, 1.06, 1.15
#: Lines may be broken at these shares of the widest one.
BREAKS = (0.75, 0.55, 0.4, 0.28)


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A place for a text: its middle, the angle [rad] of its baseline, and the end of its leader, if any."""

    x: float
    y: float
    angle: float = 0.0
    leader: tuple[float, float] | None = None


class LabelRoom:
    """The free room on a page or a piece: keeps what is occupied, and finds places for labels."""

    def __init__(self) -> None:
        self._taken: list[Geometry] = []

    def take(self, shape: Geometry) -> None:
        """Keep labels and leaders out of a shape."""
        self._taken.append(shape)

    def take_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Keep labels out of a box."""
        import shapely

        self._taken.append(shapely.box(left, bottom, right, top))

    def take_line(self, points: FloatArray, thickness: float) -> None:
        """Keep labels and leaders off a polyline (#N by 2)."""
        import shapely

        self._taken.append(shapely.LineString(points).buffer(0.5 * thickness, cap_style="square"))

    def place(
        self,
        spots: Iterable[Spot],
        width: float,
        height: float,
        page: tuple[float, float, float, float],
        avoid: Iterable[FloatArray] = (),
        *,
        may_cross: bool = True,
    ) -> Spot | None:
        """Take the first spot at which a text and its leader lie free within `page`; None if there is none.

        The lines in `avoid` are crossed only where every other spot is worse, and if they may be.

        Args:
            spots: in order of preference.
            width, height: of the text.
            page: left, bottom, right, top.
            avoid: polylines, #N by 2 each.
            may_cross: whether those lines may be crossed.
        """
        import shapely

        whole = shapely.box(*page)
        # In batches where one pass is enough: making a spot may take longer than testing it.
        spots = list(spots) if may_cross else spots
        for obstacles in ([*self._taken, *map(shapely.LineString, avoid)], self._taken)[: 1 + may_cross]:
            tree = shapely.STRtree(obstacles)
            for batch in in_batches(spots):
                boxes = _boxes(batch, width, height)
                fits = np.asarray(shapely.covers(whole, boxes))
                fits[tree.query(boxes, predicate="intersects")[0]] = False
                for k in np.flatnonzero(fits).tolist():
                    leader = leader_line(batch[k], width)
                    if leader is not None:
                        # Where a leader begins, its line may have a leader or a name already.
                        leader[0] += _AT_LINE * (leader[1] - leader[0]) / max(polyline_length(leader), _AT_LINE)
                        if shapely.intersects(shapely.LineString(leader), self._taken).any():
                            continue
                    self._taken.append(boxes[k])
                    return batch[k]
        return None

    def place_clear(
        self,
        spots: Iterable[Spot],
        width: float,
        height: float,
        avoid: Sequence[Geometry] = (),
        *,
        least: float = -1.0,
        enough: float,
    ) -> Spot | None:
        """Take the first spot whose text lies `enough` away from all else, or the farthest one.

        Args:
            spots: in order of preference.
            width, height: of the text.
            avoid: keeps off this text alone.
            least: the farthest spot must be farther than this from all else; there is no place otherwise.
            enough: distance at which no other spot is looked at.

        Returns:
            The spot; None where no spot is farther than `least`.
        """
        import shapely

        obstacles = np.array([*self._taken, *avoid], dtype=object)
        chosen, clear = None, least
        for batch in in_batches(spots):
            boxes = _boxes(batch, width, height)
            away = shapely.distance(boxes[:, None], obstacles).min(axis=1, initial=np.inf)
            for spot, box, distance in zip(batch, boxes, away.tolist(), strict=True):
                if distance > clear:
                    chosen, clear = (spot, box), distance
                if clear > enough:
                    break
            if clear > enough:
                break
        if chosen is None:
            return None
        self._taken.append(chosen[1])
        return chosen[0]


def placed_points(spots: Sequence[Spot], x: FloatArray, y: FloatArray) -> FloatArray:
    """Return where points along and across a text (#N each) come to lie at each spot (#S by #N by 2)."""
    at = np.array([(spot.x, spot.y, math.cos(spot.angle), math.sin(spot.angle)) for spot in spots])
    left, low, c, s = at.T[:, :, None]
    return np.stack([left + c * x - s * y, low + s * x + c * y], axis=-1)


def _boxes(spots: Sequence[Spot], width: float, height: float) -> FloatArray:
    """Return the polygons (#S) that a text of this size covers at each spot."""
    import shapely

    return np.asarray(shapely.polygons(placed_points(spots, *box_around(np.zeros(2), width, height).T)))


def in_batches(spots: Iterable[Spot]) -> Iterator[list[Spot]]:
    """Yield a few spots at first, since one of these will often do, then more at a time."""
    left, count = iter(spots), 4
    while batch := list(islice(left, count)):
        yield batch
        count = min(2 * count, 64)


def leader_line(spot: Spot, width: float) -> FloatArray | None:
    """Return the leader (2 by 2 [in]) from its point to a text of this width; None for a spot without one."""
    if spot.leader is None:
        return None
    side = np.copysign(1.0, spot.x - spot.leader[0])
    return np.array([spot.leader, (spot.x - side * (0.5 * width + _GAP), spot.y)])


def space_out(wanted: Sequence[float], distance: float, low: float, high: float) -> list[float]:
    """Return falling places as near as possible to those wanted, each at least `distance` below the one before.

    They stay between the bounds if there is room. Places that come too near to each other move together, as far up as
    down.
    """
    groups: list[tuple[float, int]] = []  # the middle of each, and how many
    for place in wanted:
        middle, count = place, 1
        while groups and groups[-1][0] - middle < 0.5 * (groups[-1][1] + count) * distance:
            above, more = groups.pop()
            middle, count = (above * more + middle * count) / (more + count), more + count
        groups.append((middle, count))
    places = [middle + (0.5 * (count - 1) - k) * distance for middle, count in groups for k in range(count)]
    for i, least in enumerate(low + distance * np.arange(len(places))[::-1]):
        places[i] = max(places[i], float(least))
    return [min(place, high - distance * i) for i, place in enumerate(places)]


def as_read(along: FloatArray) -> FloatArray:
    """Return the direction of a line (2), or the opposite one, in which words along it are read: to the right, or upwards."""
    return -along if along[0] < -_STEEP or (abs(along[0]) <= _STEEP and along[1] < 0) else along


def spots_along(
    line: FloatArray,
    width: float,
    clearance: float,
    *,
    shares: Sequence[float] = (0.5, 0.42, 0.58, 0.35, 0.65, 0.28, 0.72, 0.22, 0.78, 0.16, 0.84, 0.1, 0.9),
    side: str = "either",
) -> Iterator[Spot]:
    """Yield spots beside a polyline (#N by 2) and parallel to it, clear of the whole stretch however it bends.

    Args:
        line: the polyline.
        width: of the text.
        clearance: of the text's middle from the line.
        shares: of the line's length at which the text's middle may stand, in order of preference.
        side: "left" of the line as it runs, "above" it as it is read, or "either", above first.
    """
    total = polyline_length(line)
    if total < 1.05 * width:
        return
    for share in shares:
        centre = min(max(share * total, 0.52 * width), total - 0.52 * width)
        stretch = points_at_lengths(line, centre + np.linspace(-0.5, 0.5, 9) * width)
        before, after = stretch[[0, -1]]
        along = unit(after - before)
        backwards = as_read(along) is not along
        along = as_read(along)
        above = np.array([-along[1], along[0]])
        bend = (stretch - before) @ above
        offsets = {"above": float(bend.max()) + clearance, "below": float(bend.min()) - clearance}
        sides = {"either": ("above", "below"), "above": ("above",), "left": ("below" if backwards else "above",)}
        for which in sides[side]:
            x, y = 0.5 * (before + after) + offsets[which] * above
            yield Spot(x=float(x), y=float(y), angle=math.atan2(along[1], along[0]))


def spots_beyond_ends(line: FloatArray, width: float, height: float) -> Iterator[Spot]:
    """Yield level spots just beyond either end of a polyline (#N by 2 [in])."""
    for end, inner in ((line[-1], line[-2]), (line[0], line[1])):
        outwards = end - inner
        right = 1.0 if outwards[0] >= 0 else -1.0
        yield Spot(x=float(end[0] + right * (0.5 * width + 0.08)), y=float(end[1]), angle=0.0)
        up = 1.0 if outwards[1] >= 0 else -1.0
        yield Spot(x=float(end[0]), y=float(end[1] + up * (0.5 * height + 0.08)), angle=0.0)


# Offsets [in] of a text from the point that it names, outwards and upwards, nearest first; outwards is preferred.
_AROUND = sorted(
    (
        (0.08 + 0.06 * step, rise)
        for step in range(24)
        for rise in (0.0, 0.07, -0.07, 0.15, -0.15, 0.25, -0.25, 0.36, -0.36)
    ),
    key=lambda offset: math.hypot(*offset) + 0.5 * abs(offset[1]),
)


def spots_beside(
    points: Sequence[tuple[float, float]], width: float, sides: Sequence[float], *, level: float | None = None
) -> Iterator[Spot]:
    """Yield level spots to the sides (right 1, left -1) of points [in], nearest first, each with a leader to its point.

    If a `level` is given, they stand at it; there a text right beside its point has no leader.
    """
    for outwards_by, rise in _AROUND:
        for point in points:
            y = (point[1] if level is None else level) + rise
            touches = level is not None and outwards_by == _AROUND[0][0] and abs(y - point[1]) < 0.05
            for side in sides:
                x = point[0] + side * (outwards_by + 0.5 * width)
                yield Spot(x=x, y=y, angle=0.0, leader=None if touches else point)


def place_label(piece: DraftedPiece, garment: str, joints: Sequence[FloatArray]) -> Label:
    """Place the label on the widest free place of a piece, smaller if need be, or beside the piece.

    It keeps off holes, and crosses no line of the piece.

    Args:
        piece: whose label it is.
        garment: its name.
        joints: #P by 2 [m], of two sheets, which it does not cross either.
    """
    import shapely

    sew, cut = shapely.Polygon(piece.sew_line), shapely.Polygon(piece.cut_line)
    holes = [*(cutout.sew_line for cutout in piece.cutouts.values()), *piece.fisheyes.values()]
    legs = [piece.edge(leg).line for dart in piece.darts for leg in (dart.dart.left, dart.dart.right)]
    obstacles = [piece.grain, *piece.internal_lines.values(), *legs, *joints]
    away = [shapely.Polygon(hole).buffer(0) for hole in holes]
    # What it says of allowances is what is drawn.
    widened = replace(piece.piece, edges=[replace(edge.edge, allowance=edge.width) for edge in piece.edges])
    texts = tuple((text, TITLE if k == 0 else TEXT) for k, text in enumerate(label_lines(widened, garment)))
    found: list[Label] = []
    for border, line, fold in CLEARANCES:
        keep_off = [hole.buffer(border) for hole in away]
        keep_off += [shapely.LineString(obstacle).buffer(line) for obstacle in obstacles]
        keep_off += [shapely.LineString(edge.line).buffer(fold) for edge in piece.fold_edges]
        label = fit_label(sew.buffer(-border).difference(shapely.union_all(keep_off)), texts)
        found += [] if label is None else [label]
        if label is not None and _relative_size(label) >= ENOUGH:
            break
    if found:
        return max(found, key=_relative_size)
    # To the right of the cloth, with a leader to it at half its height.
    cloth = cut.buffer(0).difference(shapely.union_all(away))
    left, bottom, right, top = cloth.bounds
    rows = tuple(
        (wrap_text(text, height * BESIDE_SIZE, BESIDE_WIDTH, bold=k == 0), height * BESIDE_SIZE)
        for k, (text, height) in enumerate(texts)
    )
    beside = Label(at=np.zeros(2), lines=rows)
    beside = beside.scaled(min(1.0, BESIDE_WIDTH / beside.width))
    middle = (bottom + top) / 2
    across = shapely.LineString([(left - 1, middle), (right + 1, middle)]).intersection(cloth)
    near = max(shapely.get_parts(across), key=lambda part: part.bounds[2] if part.length > 0 else -np.inf)
    target = near.bounds[2] - min(LEADER, near.length / 2)
    start = right + BESIDE_GAP
    return replace(
        beside,
        at=np.array([start + 0.001 + beside.width / 2, middle]),
        leader=np.array([[start, middle], [target, middle]]),
    )


def _relative_size(label: Label) -> float:
    """Return the size of a label's smallest line, as a share of its full size."""
    return min(height for _, height in label.lines) / TEXT


def fit_label(area: Geometry, lines: Sequence[tuple[str, float]], *, least: float = LEAST) -> Label | None:
    """Fit lines into an area [m] as large as they get, turned or wrapped if that helps; None if too small.

    Args:
        area: where there is room [m].
        lines: (text, height of capitals [m]); they get no larger than that.
        least: smallest share of that height.
    """
    import shapely

    parts = sorted((p for p in shapely.get_parts(area) if p.geom_type == "Polygon"), key=lambda p: -p.area)[:6]
    places = _roomy_places([part for part in parts if part.area > 1e-7])
    best, reached = None, 0.0
    for label, penalty in _wrapped_labels(tuple(lines)):
        corners = []
        for row in label.words():
            # A blank row takes the room of a letter.
            wide = max(text_width(row.text, row.height, bold=row.bold), row.height)
            corners.append(box_around(row.at, wide, row.height * LEADING))
        shape = np.asarray(shapely.MultiPoint(np.concatenate(corners)).convex_hull.exterior.coords)
        # Places are made when they are first asked for.
        places, from_first = tee(places)
        for part, at, angle in from_first:
            if reached >= 1.0:  # most often at the first place
                break
            penalty_here = penalty * (TURNED if angle else 1.0)
            factor = _largest_factor(part, shape @ rotation(angle).T, at, max(least, reached * penalty_here * 1.001))
            if factor > 0.0:
                best, reached = replace(label.scaled(factor), at=at, angle=angle), factor / penalty_here
        if reached >= 1.0:
            break
    return best


def _wrapped_labels(lines: tuple[tuple[str, float], ...]) -> Iterator[tuple[Label, float]]:
    """Yield labels of full size around the origin, wrapped more and more, each with a penalty for reading it."""
    seen = set()
    # The size stays in one row: a nest replaces it by all sizes.
    size = as_sentence(translate("size {size}", size=""))
    smallest = min(height for _, height in lines)
    for heights, penalty in (([h for _, h in lines], 1.0), ([smallest for _ in lines], SMALL_TITLE)):
        plain = [(text, height) for (text, _), height in zip(lines, heights, strict=True)]
        widest = Label(at=np.zeros(2), lines=tuple(plain)).width
        for share in (1.0, *BREAKS):
            rows = tuple(
                (text if text.startswith(size) else wrap_text(text, h, share * widest * 1.001, bold=k == 0), h)
                for k, (text, h) in enumerate(plain)
            )
            if rows not in seen:
                seen.add(rows)
                breaks = sum(text.count("\n") for text, _ in rows)
                yield Label(at=np.zeros(2), lines=rows), penalty * BROKEN**breaks


def _roomy_places(parts: Sequence[Polygon]) -> Iterator[tuple[Polygon, FloatArray, float]]:
    """Yield the centres of widest ellipses, each with its polygon and the angle of lines along it.

    Those that lie flat come before those that stand, the roomiest first.
    """
    import shapely
    from shapely.affinity import scale

    for angle, axis in ((0.0, 0), (np.pi / 2, 1)):
        for ratio in ELLIPSES:
            squeeze = np.where(np.arange(2) == axis, ratio, 1.0)
            squeezed = [scale(part, *squeeze, origin=(0, 0)) for part in parts]
            circles = [shapely.maximum_inscribed_circle(part, 5e-4 * min(1.0, part.length)) for part in squeezed]
            for number in np.argsort([-circle.length for circle in circles], kind="stable"):
                yield parts[number], np.asarray(circles[number].coords[0]) / squeeze, angle


def _largest_factor(part: Polygon, shape: FloatArray, at: FloatArray, floor: float) -> float:
    """Return by what factor, at most 1, a convex shape (#P by 2 [m]) fits in around a place; 0 if below `floor`."""
    import shapely

    def fits(factor: float) -> bool:
        return bool(part.covers(shapely.Polygon(shape * factor + at)))

    if floor > 1.0 or not fits(floor):
        return 0.0
    if fits(1.0):
        return 1.0
    low, high = floor, 1.0
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def default_grain(sew_line: FloatArray, holes: Sequence[FloatArray] = ()) -> FloatArray:
    """Return a grain line (2 by 2 [m]), upwards through the widest place, over two thirds of the height there."""
    import shapely

    polygon = shapely.Polygon(sew_line)
    if holes:
        polygon = polygon.difference(shapely.union_all([shapely.Polygon(hole).buffer(0) for hole in holes]))
    centre = np.asarray(shapely.maximum_inscribed_circle(polygon, 1e-3).coords[0])
    low, high = polygon.bounds[1], polygon.bounds[3]
    ray = shapely.LineString([(centre[0], low - 1), (centre[0], high + 1)]).intersection(polygon)
    part = min(shapely.get_parts(ray), key=lambda p: p.distance(shapely.Point(centre)))
    y = np.sort(shapely.get_coordinates(part)[:, 1])
    bottom, top = float(y[0]), float(y[-1])
    return np.array([[centre[0], bottom + (top - bottom) / 6], [centre[0], top - (top - bottom) / 6]])
