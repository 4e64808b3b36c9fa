"""Feature lines of a view, and their names where there is room for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.export.labels import LabelRoom, along_line, away_from, beyond_ends
from warpflat.export.picture_pen import GRAIN, LABEL_SIZE, Pen
from warpflat.export.picture_views import INK, DrawnView

__all__ = ["draw_lines"]


def draw_lines(
    pen: Pen, room: LabelRoom, drawn: DrawnView, datum: str | None, page: tuple[float, float, float, float]
) -> list[str]:
    """Draw the lines of a view with their names, and return the names for which there was no room."""
    unnamed = []
    stretches = {}
    for name, parts in drawn.view.lines.items():
        is_datum = name == datum
        style = (0, (9, 2.5, 2, 2.5)) if is_datum else "-"
        visible = [drawn.visible_line(part) for part in parts]
        stretches[name] = max(visible, key=_length_of)
        for part, points in zip(parts, visible, strict=True):
            if drawn.view.vectors is None or is_datum:
                if len(points) > 1:
                    pen.line(points, width=1.3, colour=GRAIN if is_datum else INK, style=style, halo=True)
            else:
                drawn.draw_segments(pen.axes, np.column_stack([part[:-1], part[1:]]), width=1.1, halo=True, zorder=5)
    for name, points in stretches.items():
        if len(points) < 2:
            continue
        others = [line for other, line in stretches.items() if other != name and len(line) > 1]
        width, height = pen.measure(name, LABEL_SIZE)
        beside = [*along_line(points, width, 0.62 * height + 0.02), *beyond_ends(points, width, height)]
        spot = room.place(beside, width, height, page, others)
        spot = spot or room.place(list(away_from(points, width)), width, height, page, others)
        if spot is None:
            unnamed.append(name)
            continue
        colour = GRAIN if name == datum else INK
        angle = float(np.degrees(spot.angle))
        options = {"ha": "center", "rotation": angle, "rotation_mode": "anchor", "color": colour}
        pen.write(spot.x, spot.y, name, LABEL_SIZE, halo=True, **options)
        if spot.leader is not None:
            near = spot.x - np.copysign(0.5 * width + 0.04, spot.x - spot.leader[0])
            leader = np.array([spot.leader, (near, spot.y)])
            pen.line(leader, width=0.6, colour=colour)
            room.take_line(leader, 0.03)
    return unnamed


def _length_of(line: NDArray[np.float64]) -> float:
    """The length of a polyline (#N by 2) [in]."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
