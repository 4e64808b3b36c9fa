"""Feature lines of a view, and places for their names and other labels, so that no two overlap.

A name goes along its line where it lies all on the cloth, or beside its border, and crosses nothing. Names of other
lines that cross the piece stand beside it, one below the other, each level with the end of its line as far as there is
room.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import shapely
from shapely import Geometry

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.polyline import points_at_lengths, polyline_length, resample
from warpflat.core.text import name_without_number
from warpflat.export.figure import GRAIN, INK, LABEL_SIZE, Pen
from warpflat.export.picture_views import DrawnView

__all__ = [
    "LabelRoom",
    "Spot",
    "draw_lines",
    "leader_line",
    "space_out",
    "spots_along",
    "spots_beside",
    "spots_beyond_ends",
]

# From the end of a leader to its text [in].
_GAP = 0.04
# A name goes to the left, where the dimensions are, only if it stands nearer to its line there by this [in].
_LEFT_BONUS = 0.12
# Lines that run more steeply do not run across.
_STEEP = 3.0
# From one name to the next below it, in heights of letters.
_LINE_SPACING = 1.45
# Where leaders begin on the border.
_SHARES = (0.5, 0.42, 0.58, 0.35, 0.65, 0.28, 0.72, 0.2, 0.8, 0.12, 0.88, 0.05, 0.95)
# Nearer to another line than this [in] a name might seem to be that one's.
_LEAST_DISTANCE = 0.15
# So much of a leader [in], from the line where it begins, may lie on what is taken.
_AT_LINE = 0.09
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A place for a text: its middle [in], the angle [rad] of its baseline, and the end of its leader, if any."""

    x: float
    y: float
    angle: float
    leader: tuple[float, float] | None = None


class LabelRoom:
    """The free room on one page [in]: keeps what is occupied, and finds places for labels."""

    def __init__(self) -> None:
        self._taken = list[Geometry]()

    def take_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Keep labels out of a box."""
        self._taken.append(shapely.box(left, bottom, right, top))

    def take_line(self, points: FloatArray, thickness: float) -> None:
        """Keep labels and leaders off a polyline (#N by 2) [in]."""
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
            width, height: of the text [in].
            page: left, bottom, right, top [in].
            avoid: polylines, #N by 2 [in] each.
            may_cross: whether those lines may be crossed.
        """
        whole = shapely.box(*page)
        # In batches where one pass is enough: making a spot may take longer than testing it.
        spots = list(spots) if may_cross else spots
        for obstacles in ([*self._taken, *map(shapely.LineString, avoid)], self._taken)[: 1 + may_cross]:
            tree = shapely.STRtree(obstacles)
            for batch in _in_batches(spots):
                corners = _placed_points(batch, 0.5 * width * _CORNERS[:, 0], 0.5 * height * _CORNERS[:, 1])
                boxes = shapely.polygons(np.stack(corners, axis=-1))
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


def leader_line(spot: Spot, width: float) -> FloatArray | None:
    """Return the leader (2 by 2 [in]) from its point to a text of this width; None for a spot without one."""
    if spot.leader is None:
        return None
    side = np.copysign(1.0, spot.x - spot.leader[0])
    return np.array([spot.leader, (spot.x - side * (0.5 * width + _GAP), spot.y)])


def _rectangles(spots: Sequence[Spot], width: float, height: float) -> FloatArray:
    """Return points all over a text of this size at each spot (#S by #N by 2 [in])."""
    along = np.linspace(-0.5 * width, 0.5 * width, max(3, math.ceil(width / height)))
    x, y = (of.ravel() for of in np.meshgrid(along, (-0.5 * height, 0.0, 0.5 * height)))
    return np.stack(_placed_points(spots, x, y), axis=-1)


def _placed_points(spots: Sequence[Spot], x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where points along and across a text (#N) come to lie at each spot (#S by #N each)."""
    at = np.array([(spot.x, spot.y, math.cos(spot.angle), math.sin(spot.angle)) for spot in spots])
    left, low, c, s = at.T[:, :, None]
    return left + c * x - s * y, low + s * x + c * y


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


def _in_batches(spots: Iterable[Spot]) -> Iterator[list[Spot]]:
    """Yield a few spots at first, since one of these will often do, then more at a time."""
    left, count = iter(spots), 4
    while batch := list(islice(left, count)):
        yield batch
        count = min(2 * count, 64)


def spots_along(line: FloatArray, width: float, clearance: float) -> Iterator[Spot]:
    """Yield spots beside a polyline (#N by 2) [in] and parallel to it, from its middle outwards, on either side."""
    total = polyline_length(line)
    if total < 1.05 * width:
        return
    for share in (0.5, 0.42, 0.58, 0.35, 0.65, 0.28, 0.72, 0.22, 0.78, 0.16, 0.84, 0.1, 0.9):
        centre = min(max(share * total, 0.52 * width), total - 0.52 * width)
        stretch = points_at_lengths(line, centre + np.linspace(-0.5, 0.5, 9) * width)
        before, after = stretch[[0, -1]]
        direction = (after - before) / max(float(np.linalg.norm(after - before)), 1e-12)
        if direction[0] < -1e-3 or (abs(direction[0]) <= 1e-3 and direction[1] < 0):
            direction = -direction
        # Beside the whole stretch, however it bends.
        bend = (stretch - before) @ np.array([-direction[1], direction[0]])
        middle = 0.5 * (before + after)
        for offset in (float(bend.max()) + clearance, float(bend.min()) - clearance):
            x, y = middle + offset * np.array([-direction[1], direction[0]])
            yield Spot(x=float(x), y=float(y), angle=math.atan2(direction[1], direction[0]))


def spots_beyond_ends(line: FloatArray, width: float, height: float) -> Iterator[Spot]:
    """Yield level spots just beyond either end of a polyline (#N by 2) [in]."""
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


def _spots_away_from(line: FloatArray, width: float) -> Iterator[Spot]:
    """Yield level spots away from the middle of a polyline (#N by 2) [in], each with a leader to it."""
    middle = line[len(line) // 2]
    for side in (1.0, -1.0):
        for outwards_by in (0.25, 0.5, 0.8, 1.2):
            for lift in (0.0, 0.25, -0.25, 0.5, -0.5):
                x, y = float(middle[0]) + side * (0.5 * width + outwards_by), float(middle[1]) + lift
                yield Spot(x=x, y=y, angle=0.0, leader=(float(middle[0]), float(middle[1])))


def draw_lines(
    pen: Pen,
    room: LabelRoom,
    drawn: DrawnView,
    datum: str | None,
    page: tuple[float, float, float, float],
    others: Sequence[DrawnView] = (),
) -> list[str]:
    """Draw the lines of a view with their names, none of them on the cloth of other views; return the names for which there was no room."""
    names = _Names(pen, room, drawn, datum, page, others)
    inner, border = names.inside(), names.on_border()
    names.place_along(inner, covered=True)
    names.place_beside(inner)
    names.place_along(border, covered=False)
    names.place_along(border, covered=True)
    names.place_outside(border)
    names.place_outside(names.across(inner))
    names.place_anywhere()
    return names.unplaced


class _Names:
    """The names of a view's lines, and which are not written yet."""

    def __init__(
        self,
        pen: Pen,
        room: LabelRoom,
        drawn: DrawnView,
        datum: str | None,
        page: tuple[float, float, float, float],
        others: Sequence[DrawnView],
    ) -> None:
        """Draw the lines of a view; their names come later."""
        self._others = others
        self._pen, self._room, self._drawn, self._datum, self._page = pen, room, drawn, datum, page
        stretches = {
            name: _draw_line(pen, drawn, parts, is_datum=name == datum) for name, parts in drawn.view.lines.items()
        }
        # The legs of darts need no names: everybody sees what they are.
        named = (name for name in stretches if not name.endswith((".left", ".right")))
        self._lines = {name: stretches[name] for name in named if len(stretches[name]) > 1}
        # The stretches of a line between darts need one name together.
        self.unplaced = [name for name in self._lines if name_without_number(name, self._lines) == name]

    def on_border(self) -> list[str]:
        """Return the names of lines most of whose vertices are on the border."""
        border = np.unique(self._drawn.view.facets.outline)
        parts = self._drawn.view.lines
        return [name for name in self._lines if np.isin(np.concatenate(parts[name]), border).mean() > 0.5]

    def inside(self) -> list[str]:
        """Return the names of the other lines."""
        border = set(self.on_border())
        return [name for name in self._lines if name not in border]

    def across(self, names: Iterable[str]) -> list[str]:
        """Return the names that are not placed yet and whose lines run across."""
        found = []
        for name in self._unplaced(names):
            along = np.subtract(*reversed(self._ends(name)))
            if abs(along[1]) <= _STEEP * along[0]:
                found.append(name)
        return found

    def _ends(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return the points at which a line is farthest to the left and to the right."""
        line = self._lines[name]
        return line[np.argmin(line[:, 0])], line[np.argmax(line[:, 0])]

    def place_along(self, names: Iterable[str], *, covered: bool) -> None:
        """Place names along their lines, all on the cloth or all off it."""
        for name in self._unplaced(names):
            width, height = self._size(name)
            spots = spots_along(self._lines[name], width, 0.62 * height + 0.02)
            self._place(name, self._spots_on_cloth(spots, width, height, covered=covered), may_cross=False)

    def place_beside(self, names: Iterable[str]) -> None:
        """Place the names of lines that run across beside the piece, one below the other."""
        _, bottom, _, top = self._page
        sides: dict[float, list[tuple[float, str, tuple[float, float]]]] = {1.0: [], -1.0: []}
        for name in self.across(names):
            first, last = self._ends(name)
            left, right = (self._leader_length(name, end, side) for end, side in ((first, -1.0), (last, 1.0)))
            side, end = (-1.0, first) if left < right - _LEFT_BONUS else (1.0, last)
            sides[side].append((-float(end[1]), name, (float(end[0]), float(end[1]))))
        for side, ends in sides.items():
            if not ends:
                continue
            height = max(self._size(name)[1] for _, name, _ in ends)
            ends = sorted(ends)
            levels = space_out([-below for below, _, _ in ends], _LINE_SPACING * height, bottom + height, top - height)
            for level, (_, name, there) in zip(levels, ends, strict=True):
                width, height = self._size(name)
                spots = spots_beside([there], width, [side], level=level)
                self._place(name, self._spots_on_cloth(spots, width, height, covered=False), may_cross=False)

    def _leader_length(self, name: str, end: FloatArray, side: float) -> float:
        """Return the length of the leader [in] from a line's end to its name off the cloth, to one side."""
        width, height = self._size(name)
        spots = spots_beside([(float(end[0]), float(end[1]))], width, [side])
        out = next(self._spots_on_cloth(spots, width, height, covered=False), None)
        leader = None if out is None else leader_line(out, width)
        return np.inf if leader is None else polyline_length(leader)

    def place_outside(self, names: Iterable[str]) -> None:
        """Place names off the cloth beside their lines, level, as near as there is room."""
        for name in self._unplaced(names):
            width, height = self._size(name)
            # A leader begins at a point of the line that is not near to other lines, if there is one.
            points = resample(self._lines[name], _SHARES)
            others = np.concatenate([np.empty((0, 2)), *(line for other, line in self._lines.items() if other != name)])
            away = np.linalg.norm(points[:, None] - others, axis=2).min(axis=1, initial=np.inf)
            clear = away > _LEAST_DISTANCE if (away > _LEAST_DISTANCE).any() else np.ones(len(points), dtype=bool)
            spots = spots_beside([(x, y) for x, y in points[clear].tolist()], width, (1.0, -1.0))
            self._place(name, self._spots_on_cloth(spots, width, height, covered=False), may_cross=False)

    def place_anywhere(self) -> None:
        """Place names wherever there is room."""
        for name in self._unplaced(self.unplaced):
            line = self._lines[name]
            width, height = self._size(name)
            near = [*spots_along(line, width, 0.62 * height + 0.02), *spots_beyond_ends(line, width, height)]
            _ = self._place(name, near) or self._place(name, _spots_away_from(line, width))

    def _unplaced(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.unplaced]

    def _size(self, name: str) -> tuple[float, float]:
        return self._pen.measure(name, LABEL_SIZE)

    def _spots_on_cloth(self, spots: Iterable[Spot], width: float, height: float, *, covered: bool) -> Iterator[Spot]:
        """Yield the spots at which a text lies all on the cloth (`covered`), or all off it."""
        for batch in _in_batches(spots):
            points = _rectangles(batch, width, height)
            on = self._drawn.covers(points.reshape(-1, 2)).reshape(points.shape[:2])
            clear = (on if covered else ~on).all(axis=1)
            yield from (batch[k] for k in np.flatnonzero(clear).tolist())

    def _spots_off_others(self, spots: Iterable[Spot], width: float, height: float) -> Iterator[Spot]:
        """Yield the spots at which a text lies on no cloth of another view."""
        for batch in _in_batches(spots):
            points = _rectangles(batch, width, height)
            clear = np.ones(len(batch), dtype=bool)
            for other in self._others:
                clear &= ~other.covers(points.reshape(-1, 2)).reshape(points.shape[:2]).any(axis=1)
            yield from (batch[k] for k in np.flatnonzero(clear).tolist())

    def _place(self, name: str, spots: Iterable[Spot], *, may_cross: bool = True) -> bool:
        """Write a name at the first spot where there is room for it, and return whether there is one."""
        pen, (width, height) = self._pen, self._size(name)
        others = [line for other, line in self._lines.items() if other != name]
        spots = self._spots_off_others(spots, width, height)
        spot = self._room.place(spots, width, height, self._page, others, may_cross=may_cross)
        if spot is None:
            return False
        colour = GRAIN if name == self._datum else INK
        angle = float(np.degrees(spot.angle))
        options = {"ha": "center", "rotation": angle, "rotation_mode": "anchor", "color": colour}
        pen.write(spot.x, spot.y, name, LABEL_SIZE, halo=True, **options)
        leader = leader_line(spot, width)
        if leader is not None:
            pen.line(leader, width=0.6, colour=colour)
            self._room.take_line(leader, 0.03)
        self.unplaced.remove(name)
        return True


def _draw_line(pen: Pen, drawn: DrawnView, parts: list[IntArray], *, is_datum: bool) -> FloatArray:
    """Draw a line, and return the longest stretch of it that can be seen, #N by 2 [in]."""
    visible = [drawn.visible_line(part) for part in parts]
    for part, points in zip(parts, visible, strict=True):
        if drawn.view.vectors is None or is_datum:
            if len(points) > 1:
                style = (0, (9, 2.5, 2, 2.5)) if is_datum else "-"
                pen.line(points, width=1.3, colour=GRAIN if is_datum else INK, style=style, halo=True)
        else:
            drawn.draw_segments(pen.axes, np.column_stack([part[:-1], part[1:]]), width=1.1, halo=True, zorder=5)
    return max(visible, key=polyline_length)
