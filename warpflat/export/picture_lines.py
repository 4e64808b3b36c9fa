"""Feature lines of a view, and their names where there is room for them.

A name goes along its line where it lies all on the cloth, or beside its border, and crosses nothing. Names of other
lines that cross the piece stand beside it, one below the other, each level with the end of its line as far as there is
room.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.polyline import polyline_length, resample
from warpflat.core.text import name_without_number
from warpflat.export.figure import GRAIN, INK, LABEL_SIZE, Pen
from warpflat.export.labels import (
    LabelRoom,
    Spot,
    in_batches,
    leader_line,
    points_on,
    rectangles,
    space_out,
    spots_along,
    spots_away_from,
    spots_beside,
    spots_beyond_ends,
)
from warpflat.export.picture_views import DrawnView

__all__ = ["draw_lines"]


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
        _, height = pen.measure("x", LABEL_SIZE)
        self._ink = {name: points_on(line, 0.5 * height) for name, line in self._lines.items()}
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
            way = np.subtract(*reversed(self._ends(name)))
            if abs(way[1]) <= _STEEP * way[0]:
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
            spots = spots_beside(self._points_clear_of_others(name), width, (1.0, -1.0))
            self._place(name, self._spots_on_cloth(spots, width, height, covered=False), may_cross=False)

    def _points_clear_of_others(self, name: str) -> list[tuple[float, float]]:
        """Return points of a line that are not near to others, if there are such."""
        points = resample(self._lines[name], _SHARES)
        others = np.concatenate([np.empty((0, 2)), *(line for other, line in self._lines.items() if other != name)])
        away = np.linalg.norm(points[:, None] - others, axis=2).min(axis=1, initial=np.inf)
        clear = away > _LEAST_DISTANCE if (away > _LEAST_DISTANCE).any() else np.ones(len(points), dtype=bool)
        return [(x, y) for x, y in points[clear].tolist()]

    def place_anywhere(self) -> None:
        """Place names wherever there is room."""
        for name in self._unplaced(self.unplaced):
            line = self._lines[name]
            width, height = self._size(name)
            near = [*spots_along(line, width, 0.62 * height + 0.02), *spots_beyond_ends(line, width, height)]
            _ = self._place(name, near) or self._place(name, spots_away_from(line, width))

    def _unplaced(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.unplaced]

    def _size(self, name: str) -> tuple[float, float]:
        return self._pen.measure(name, LABEL_SIZE)

    def _spots_on_cloth(self, spots: Iterable[Spot], width: float, height: float, *, covered: bool) -> Iterator[Spot]:
        """Yield the spots at which a text lies all on the cloth (`covered`), or all off it."""
        for batch in in_batches(spots):
            points = rectangles(batch, width, height)
            on = self._drawn.covers(points.reshape(-1, 2)).reshape(points.shape[:2])
            clear = (on if covered else ~on).all(axis=1)
            yield from (batch[k] for k in np.flatnonzero(clear).tolist())

    def _spots_off_others(self, spots: Iterable[Spot], width: float, height: float) -> Iterator[Spot]:
        """Yield the spots at which a text lies on no cloth of another view."""
        for batch in in_batches(spots):
            points = rectangles(batch, width, height)
            clear = np.ones(len(batch), dtype=bool)
            for other in self._others:
                clear &= ~other.covers(points.reshape(-1, 2)).reshape(points.shape[:2]).any(axis=1)
            yield from (batch[k] for k in np.flatnonzero(clear).tolist())

    def _place(self, name: str, spots: Iterable[Spot], *, may_cross: bool = True) -> bool:
        """Write a name at the first spot where there is room for it, and return whether there is one."""
        pen, (width, height) = self._pen, self._size(name)
        others = np.concatenate([np.empty((0, 2)), *(ink for other, ink in self._ink.items() if other != name)])
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
