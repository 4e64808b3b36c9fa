"""Feature lines of a view, and their names, so that no two overlap.

A name goes along its line where it lies all on the cloth, or beside its border, and crosses nothing. Names of other
lines that cross the piece stand beside it, one below the other, each level with the end of its line as far as there is
room.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from warpflat.core import BoolArray, FloatArray, polyline_length, resample
from warpflat.pattern.drafting.names import name_without_number
from warpflat.pattern.drafting.placement import (
    LabelRoom,
    Spot,
    in_batches,
    leader_line,
    placed_points,
    space_out,
    spots_along,
    spots_beside,
    spots_beyond_ends,
)
from warpflat.pattern.export.figure import GRAIN, INK, LABEL_SIZE, Pen
from warpflat.pattern.export.views import DrawnView

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
    others: Sequence[DrawnView],
) -> list[str]:
    """Draw the lines of a view with their names, none of them on the cloth of other views; return the names for which there was no room."""
    lines = dict[str, FloatArray]()
    for name, parts in drawn.view.lines.items():
        visible = [drawn.visible_line(part) for part in parts]
        for part, points in zip(parts, visible, strict=True):
            if drawn.view.vectors is None or name == datum:
                if len(points) > 1:
                    style = (0, (9, 2.5, 2, 2.5)) if name == datum else "-"
                    pen.line(points, width=1.3, colour=GRAIN if name == datum else INK, linestyle=style, halo=True)
            else:
                drawn.draw_segments(np.column_stack([part[:-1], part[1:]]), width=1.1, halo=True)
        longest = max(visible, key=polyline_length)
        # The legs of darts need no names: everybody sees what they are.
        if len(longest) > 1 and not name.endswith((".left", ".right")):
            lines[name] = longest
    names = _Names(pen, room, drawn, datum, page, others, lines)
    on_border = np.unique(drawn.view.facets.outline)
    border = [name for name in lines if np.isin(np.concatenate(drawn.view.lines[name]), on_border).mean() > 0.5]
    inner = [name for name in lines if name not in border]
    names.place_along(inner, covered=True)
    names.place_in_columns(inner)
    names.place_along(border, covered=False)
    names.place_along(border, covered=True)
    names.place_outside(border)
    names.place_outside(names.across(inner))
    names.place_anywhere()
    return names.unplaced


class _Names:
    """The names of lines of a view, written where there is room for them.

    Attributes:
        unplaced: names that have no place yet; the stretches of a line between darts need one name together.
    """

    def __init__(
        self,
        pen: Pen,
        room: LabelRoom,
        drawn: DrawnView,
        datum: str | None,
        page: tuple[float, float, float, float],
        others: Sequence[DrawnView],
        lines: Mapping[str, FloatArray],
    ) -> None:
        self._pen, self._room, self._drawn, self._datum, self._page = pen, room, drawn, datum, page
        self._others, self._lines = others, lines
        self._sizes = {name: pen.measure(name, LABEL_SIZE) for name in lines}
        self.unplaced = [name for name in lines if name_without_number(name, lines) == name]

    def _place(self, name: str, spots: Iterable[Spot], *, may_cross: bool = True) -> None:
        """Write a name at the first spot where there is room for it, on no cloth of another view."""
        width, height = self._sizes[name]
        for other in self._others:
            spots = _spots_on_cloth(other, spots, width, height, share=0.0)
        avoid = [line for other, line in self._lines.items() if other != name]
        spot = self._room.place(spots, width, height, self._page, avoid, may_cross=may_cross)
        if spot is None:
            return
        colour = GRAIN if name == self._datum else INK
        angle = float(np.degrees(spot.angle))
        options = {"ha": "center", "rotation": angle, "rotation_mode": "anchor", "color": colour}
        self._pen.write(spot.x, spot.y, name, LABEL_SIZE, halo=True, **options)
        leader = leader_line(spot, width)
        if leader is not None:
            self._pen.line(leader, width=0.6, colour=colour)
            self._room.take_line(leader, 0.03)
        self.unplaced.remove(name)

    def _off_cloth(self, name: str, spots: Iterable[Spot]) -> Iterator[Spot]:
        return _spots_on_cloth(self._drawn, spots, *self._sizes[name], share=0.0)

    def _left(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.unplaced]

    def place_along(self, names: Iterable[str], *, covered: bool) -> None:
        """Place names along their lines, all on the cloth or all off it."""
        for name in self._left(names):
            width, height = self._sizes[name]
            spots = spots_along(self._lines[name], width, 0.62 * height + 0.02)
            on_cloth = _spots_on_cloth(self._drawn, spots, width, height, share=float(covered))
            self._place(name, on_cloth, may_cross=False)

    def place_outside(self, names: Iterable[str]) -> None:
        """Place names off the cloth beside their lines, level, as near as there is room."""
        for name in self._left(names):
            # A leader begins at a point of the line that is not near to other lines, if there is one.
            points, others = (
                resample(self._lines[name], _SHARES),
                [each for other, each in self._lines.items() if other != name],
            )
            beside = np.concatenate([np.empty((0, 2)), *others])
            away = np.linalg.norm(points[:, None] - beside, axis=2).min(axis=1, initial=np.inf)
            clear = away > _LEAST_DISTANCE if (away > _LEAST_DISTANCE).any() else np.ones(len(points), dtype=bool)
            spots = spots_beside([(x, y) for x, y in points[clear].tolist()], self._sizes[name][0], (1.0, -1.0))
            self._place(name, self._off_cloth(name, spots), may_cross=False)

    def across(self, names: Iterable[str]) -> dict[str, dict[float, tuple[float, float]]]:
        """Return the names without a place whose lines run across, each with the ends to the left (-1) and right (1)."""
        found = dict[str, dict[float, tuple[float, float]]]()
        for name in self._left(names):
            line = self._lines[name]
            first, last = line[np.argmin(line[:, 0])], line[np.argmax(line[:, 0])]
            if abs(last[1] - first[1]) <= _STEEP * (last[0] - first[0]):
                found[name] = {side: (float(end[0]), float(end[1])) for side, end in ((-1.0, first), (1.0, last))}
        return found

    def place_in_columns(self, names: Iterable[str]) -> None:
        """Place names of lines that run across beside the piece, one below the other, where the leader is shorter."""
        columns: dict[float, list[tuple[float, str, tuple[float, float]]]] = {1.0: [], -1.0: []}
        for name, ends in self.across(names).items():
            width, lengths = self._sizes[name][0], dict[float, float]()
            for side, end in ends.items():
                out = next(self._off_cloth(name, spots_beside([end], width, [side])), None)
                leader = None if out is None else leader_line(out, width)
                lengths[side] = np.inf if leader is None else polyline_length(leader)
            side = -1.0 if lengths[-1.0] < lengths[1.0] - _LEFT_BONUS else 1.0
            columns[side].append((-ends[side][1], name, ends[side]))
        for side, named in columns.items():
            height = max((self._sizes[name][1] for _, name, _ in named), default=0.0)
            wanted = [-below for below, _, _ in sorted(named)]
            levels = space_out(wanted, _LINE_SPACING * height, self._page[1] + height, self._page[3] - height)
            for level, (_, name, end) in zip(levels, sorted(named), strict=True):
                spots = spots_beside([end], self._sizes[name][0], [side], level=level)
                self._place(name, self._off_cloth(name, spots), may_cross=False)

    def place_anywhere(self) -> None:
        """Place names wherever there is room: on the cloth, beyond an end, away from the middle."""
        for name in list(self.unplaced):
            line, (width, height) = self._lines[name], self._sizes[name]
            self._place(
                name, [*spots_along(line, width, 0.62 * height + 0.02), *spots_beyond_ends(line, width, height)]
            )
            if name in self.unplaced:
                x, y = line[len(line) // 2].tolist()
                spots = [
                    Spot(x=x + side * (0.5 * width + outwards), y=y + rise, leader=(x, y))
                    for side in (1.0, -1.0)
                    for outwards in (0.25, 0.5, 0.8, 1.2)
                    for rise in (0.0, 0.25, -0.25, 0.5, -0.5)
                ]
                self._place(name, spots)


def _spots_on_cloth(
    view: DrawnView, spots: Iterable[Spot], width: float, height: float, *, share: float
) -> Iterator[Spot]:
    """Yield the spots at which a view's cloth lies below this share of a text: below all of it (1), or below none (0)."""
    along = np.linspace(-0.5 * width, 0.5 * width, max(3, math.ceil(width / height)))
    x, y = (of.ravel() for of in np.meshgrid(along, (-0.5 * height, 0.0, 0.5 * height)))
    for batch in in_batches(spots):
        covered: BoolArray = view.covers(placed_points(batch, x, y).reshape(-1, 2)).reshape(len(batch), -1)
        yield from (batch[k] for k in np.flatnonzero(covered.mean(axis=1) == share).tolist())
