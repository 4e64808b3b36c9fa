"""What is written on a piece and where there is room for it; the grain line of a piece that names none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.pattern.pieces import Piece

__all__ = ["Label", "default_grain", "label_lines", "place_label"]

Vector = NDArray[np.float64]

#: Height of capitals [m]: the piece's name, the other lines; and the distance of lines as a multiple of it.
TITLE, TEXT, LEADING = 0.007, 0.0045, 1.55
#: Mean width of a letter over the height of capitals.
LETTER = 0.72
#: Labels are wide: room is sought by an ellipse of this ratio of height to width.
ELLIPSE = 0.4


@dataclass(frozen=True, kw_only=True, eq=False)
class Label:
    """Lines of text, centred.

    Attributes:
        at: the centre [m].
        lines: (text, height of capitals [m]) from top to bottom.
    """

    at: Vector
    lines: tuple[tuple[str, float], ...]

    @property
    def height(self) -> float:
        """Of the whole block [m]."""
        return sum(height * LEADING for _, height in self.lines)


def label_lines(piece: Piece, garment: str) -> tuple[str, ...]:
    """Name, size, how to cut it, cloth, garment and which allowances are included."""
    if piece.on_fold:
        cut = f"Cut {piece.quantity} on fold"
    elif piece.quantity % 2 == 0 and piece.paired:
        half = piece.quantity // 2
        cut = f"Cut {piece.quantity}, {half} mirrored"
    else:
        cut = f"Cut {piece.quantity}"
    lines = [piece.name.replace("_", " ").upper()]
    if piece.size:
        lines.append(f"Size {piece.size}")
    lines.append(cut + (f" - {piece.fabric}" if piece.fabric else ""))
    widths = {}
    for kind in ("seam", "hem"):
        values = sorted({round(e.width * 1000, 1) for e in piece.edges if e.kind == kind})
        if values:
            widths[kind] = "/".join(f"{v:g}" for v in values) + " mm"
    if widths:
        lines.append("Includes " + ", ".join(f"{kind} {text}" for kind, text in widths.items()))
    title = garment.replace("_", " ")
    if title.upper() != lines[0]:
        lines.append(title)
    return tuple(lines)


def place_label(
    piece: Piece, garment: str, sew_line: Vector, obstacles: Sequence[Vector], folds: Sequence[Vector]
) -> Label:
    """The label in the widest free place of the piece, smaller where there is little room."""
    import shapely
    from shapely.affinity import scale

    inside = shapely.Polygon(sew_line).buffer(-0.004)
    keep_off = [shapely.LineString(line).buffer(0.006) for line in obstacles]
    keep_off += [shapely.LineString(line).buffer(0.022) for line in folds]
    free = inside.difference(shapely.union_all(keep_off))
    room = [part for part in shapely.get_parts(free) if part.geom_type == "Polygon" and part.area > 1e-5]
    texts = label_lines(piece, garment)
    lines = [(text, TITLE if i == 0 else TEXT) for i, text in enumerate(texts)]
    if not room:
        room = [shapely.Polygon(sew_line).buffer(0)]
    circles = [shapely.maximum_inscribed_circle(scale(part, xfact=ELLIPSE, origin=(0, 0)), 5e-4) for part in room]
    best = max(circles, key=lambda circle: circle.length)
    centre = np.asarray(best.coords[0]) / [ELLIPSE, 1.0]
    half_width = max(len(text) * height * LETTER for text, height in lines) / 2
    half_height = sum(height * LEADING for _, height in lines) / 2
    radius = max(float(best.length), 1e-4)
    fit = 1.0 / float(np.hypot(half_width * ELLIPSE / radius, half_height / radius))
    factor = float(np.clip(fit, 0.3, 1.0))
    return Label(at=centre, lines=tuple((text, height * factor) for text, height in lines))


def default_grain(sew_line: Vector) -> Vector:
    """2 by 2 [m], upwards through the widest place, two thirds of the height there."""
    import shapely

    polygon = shapely.Polygon(sew_line)
    centre = np.asarray(shapely.maximum_inscribed_circle(polygon, 1e-3).coords[0])
    low, high = polygon.bounds[1], polygon.bounds[3]
    ray = shapely.LineString([(centre[0], low - 1), (centre[0], high + 1)]).intersection(polygon)
    part = min(shapely.get_parts(ray), key=lambda p: p.distance(shapely.Point(centre)))
    y = np.sort(shapely.get_coordinates(part)[:, 1])
    bottom, top = float(y[0]), float(y[-1])
    return np.array([[centre[0], bottom + (top - bottom) / 6], [centre[0], top - (top - bottom) / 6]])
