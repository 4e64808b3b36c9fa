"""Cloth beyond the centre line: button stands with marked buttonholes and buttons, and wraps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, find_unused_name, part_between, points_at_lengths
from warpflat.garment.construction.facings import STAND, STAND_END
from warpflat.garment.construction.openings import Buttons, Opening
from warpflat.pattern import FOLD_STRAIGHT, Edge, Piece

__all__ = ["bust_depth", "button_depths", "buttonhole", "with_button_stand", "with_wrap"]

# The first button lies this far below the edge, beside half of its own width [m], and the last at least this share of
# the spacing above the lower end.
_BELOW, _LEFT_BELOW = 0.010, 0.6
# A buttonhole is longer than the button is wide [m], and reaches so far beyond the centre, where the button's shank lies.
_THICKNESS, _SHANK = 0.003, 0.003
# Half the length of the bars at the ends of a buttonhole [m].
_BAR = 0.004
# Allowance of the edge of a wrap, which is turned in twice [m], and the least of an edge that is left beside it.
_WRAP_HEM, _LEAST_LEFT = 0.020, 0.020


def button_depths(buttons: Buttons, length: float, bust: float | None, count: int | None = None) -> FloatArray:
    """Return how far below the upper edge the buttons lie [m].

    Args:
        buttons: what is wanted.
        length: of the opening [m].
        bust: depth of the bust line, on which a button lies [m]; None where it crosses none.
        count: of another size, to which this one keeps.

    Raises:
        InputError: there is no room for two buttons.
    """
    first, count = 0.5 * buttons.diameter + _BELOW, buttons.count or count
    if count is not None:
        spacing = (length - first) / max(count - 1 + _LEFT_BELOW, 1.0)
    else:
        spacing = buttons.spacing
        if bust is not None and bust - first > 0.5 * spacing:
            spacing = (bust - first) / round((bust - first) / spacing)
        count = int((length - first) / spacing - _LEFT_BELOW) + 1
    if count < 2 or spacing <= buttons.diameter:
        raise InputError(f"no room for buttons {1e3 * buttons.diameter:.0f} mm wide on {1e3 * length:.0f} mm")
    return np.asarray(first + spacing * np.arange(count))


def with_button_stand(piece: Piece, name: str, opening: Opening, end: float, depths: FloatArray) -> Piece:
    """Return a piece that runs beyond one of its edges, with its buttons marked.

    The upper and the lower end of the stand are mirror images of the edges there, so that they lie upon the other
    half's where it is buttoned.

    Args:
        piece: one half.
        name: of its straight edge.
        opening: width of the stand, and its buttons.
        end: length of the stand, from the upper end of the edge [m].
        depths: of the buttons of this piece, from the upper end of the edge [m].

    Raises:
        InputError: the edge is not straight.
    """
    edges, upper, lower, down, out = _beside(piece, name, "have a button stand")
    at = [edge.name for edge in edges].index(name)
    edge = edges[at]
    top, low = edge.points[[0, -1] if down else [-1, 0]]
    along = (low - top) / np.linalg.norm(low - top)
    whole = end > edge.length - 1e-6
    reach = _mirrored(upper.points[::-1] if down else upper.points, top, out, opening.width)
    if whole:
        foot = _mirrored(lower.points if down else lower.points[::-1], low, out, opening.width)
    else:
        corner = top + end * along
        foot = np.array([corner, corner + opening.width * out])
    stand = Edge(name=f"{name} {STAND}", points=_turned([reach[-1], foot[-1]], down))
    ends = {
        upper.name: replace(
            upper,
            vertices=None,
            points=np.vstack([upper.points, reach[1:]] if down else [reach[::-1], upper.points[1:]]),
        )
    }
    new = [stand]
    if whole:
        ends[lower.name] = replace(
            lower, vertices=None, points=np.vstack([foot[::-1], lower.points[1:]] if down else [lower.points, foot[1:]])
        )
    else:
        rest = edge.points[np.argsort((edge.points - top) @ along)]
        rest = np.vstack([foot[0], rest[(rest - top) @ along > end + 1e-6]])
        step = Edge(name=f"{name} {STAND_END}", points=_turned(foot[::-1], down))
        new = [stand, step, replace(edge, points=_turned(rest, down), vertices=None)]
    edges[at : at + 1] = new if down else new[::-1]
    edges = [ends.get(each.name, each) for each in edges]
    lines = dict(piece.internal_lines)
    lines = {find_unused_name(name, lines): np.array([top, (top + min(end, edge.length) * along)]), **lines}
    # A mark for each button, and a line for each buttonhole across the stand.
    assert opening.buttons is not None
    marks = dict(piece.marks)
    for depth in depths:
        centre = top + depth * along
        marks[find_unused_name("button", marks)] = centre
        ends = centre + np.outer([_SHANK, _SHANK - opening.buttons.diameter - _THICKNESS], out)
        lines[find_unused_name("buttonhole", lines)] = ends
        for end in ends:
            lines[find_unused_name("buttonhole end", lines)] = end + np.outer([-_BAR, _BAR], along)
    return replace(piece, edges=edges, internal_lines=lines, marks=marks)


def with_wrap(piece: Piece, name: str, opening: Opening) -> Piece:
    """Return a half that runs beyond a centre line, all along it, to lie over the other half.

    Its new edge, "wrap edge", ends as far beyond the line as the wrap is wide, measured along the mirror images of the half's upper and
    lower edge. Where the upper edge is the neckline, that becomes a straight line from the shoulder to the waist, or to the lower end of
    a bodice.

    Args:
        piece: one half.
        name: of its straight edge.
        opening: width of the wrap, and length of its ties.

    Raises:
        InputError: the edge is not straight, or one beside it is shorter than the wrap is wide.
    """
    import shapely

    edges, upper, lower, down, out = _beside(piece, name, "be wrapped")
    centre = _turned(piece.edge(name).points, down)

    def mirrored(edge: Edge, corner: FloatArray) -> FloatArray:
        line = edge.points if np.array_equal(edge.points[0], corner) else edge.points[::-1]
        if edge.length < opening.width + _LEAST_LEFT:
            raise InputError(
                f"{piece.name}.{edge.name} is {1e3 * edge.length:.0f} mm long up to its next corner or dart, too short for a wrap of "
                f"{1e3 * opening.width:.0f} mm"
            )
        part = part_between(line, 0.0, opening.width)
        return np.asarray(part + 2.0 * np.outer((corner - part) @ out, out))

    foot = mirrored(lower, centre[-1])
    if upper.name == "neck":
        waists = [line for key, line in piece.internal_lines.items() if key.startswith("waist")]
        crossed = [
            end
            for line in waists
            for end in line[[0, -1]]
            if shapely.LineString(centre).distance(shapely.Point(end)) < 1e-3
        ]
        corner = crossed[0] + opening.width * out if crossed else foot[-1]
        head = np.array([_turned(upper.points, down)[0], corner])
    else:
        head = np.vstack([_turned(upper.points, down), mirrored(upper, centre[0])[1:]])
    new = {upper.name: replace(upper, points=_turned(head, down), vertices=None)}
    if np.linalg.norm(foot[-1] - head[-1]) > _LEAST_LEFT:
        new[name] = Edge(name="wrap edge", points=_turned([head[-1], foot[-1]], down), kind="hem", allowance=_WRAP_HEM)
    tail = np.vstack([foot[::-1], _turned(lower.points, down)[1:]])
    new[lower.name] = replace(lower, points=_turned(tail, down), vertices=None)
    lines = dict(piece.internal_lines)
    lines[find_unused_name(name, lines)] = centre
    marks = (
        {**piece.marks, "tie": head[-1]}
        if opening.tie and (upper.name != "neck" or len(new) == 3)
        else dict(piece.marks)
    )
    kept = [new.get(edge.name, edge) for edge in edges if edge.name != name or name in new]
    return replace(piece, edges=kept, internal_lines=lines, marks=marks)


def _beside(piece: Piece, name: str, what: str) -> tuple[list[Edge], Edge, Edge, bool, FloatArray]:
    """Return the edges of a half, those above and below its straight edge, whether that runs down, and the direction beyond it.

    Raises:
        InputError: the edge is not straight, so that the piece cannot do `what`.
    """
    edges = list(piece.edges)
    at = [edge.name for edge in edges].index(name)
    points, before, after = edges[at].points, edges[at - 1], edges[(at + 1) % len(edges)]
    grain = np.array([0.0, 1.0]) if piece.grain is None else piece.grain[1] - piece.grain[0]
    down = bool((points[-1] - points[0]) @ grain < 0.0)
    along = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    out = np.array([along[1], -along[0]])
    stray = float(np.abs((points - points[0]) @ out).max())
    if stray > FOLD_STRAIGHT:
        raise InputError(
            f"{piece.name}.{name} strays {1e3 * stray:.1f} mm from straight and cannot {what}; constrain it, "
            f'[[constraints]] line = "{name}", straight = "warp"'
        )
    return edges, *((before, after) if down else (after, before)), down, out


def buttonhole(centre: FloatArray, along: FloatArray, diameter: float = 0.012) -> dict[str, FloatArray]:
    """Return the lines of a buttonhole on a cuff, a collar or a waistband (2 by 2 [m] each), for a small button.

    Args:
        centre: its middle [m].
        along: its direction.
        diameter: of the button [m].
    """
    half, across = 0.5 * (diameter + _THICKNESS), np.array([-along[1], along[0]])
    ends = centre + np.outer([-half, half], along)
    bars = {f"buttonhole end {k}": end + np.outer([-_BAR, _BAR], across) for k, end in enumerate(ends, start=1)}
    return {"buttonhole": ends, **bars}


def _turned(points: FloatArray | list[FloatArray], down: bool) -> FloatArray:
    """Return points that run downwards in the direction of the outline."""
    points = np.asarray(points)
    return points if down else points[::-1]


def _mirrored(points: FloatArray, corner: FloatArray, out: FloatArray, width: float) -> FloatArray:
    """Return the mirror image of a line that begins in a corner, up to a distance beyond it (#P by 2 [m])."""
    away = np.maximum.accumulate(np.maximum(0.0, (corner - points) @ out))
    if away[-1] < width:
        raise InputError(f"an edge beside the button stand is narrower than its {1e3 * width:.0f} mm")
    image = points + 2.0 * np.outer((corner - points) @ out, out)
    length = float(np.interp(width, away, arc_lengths(points)))
    end = points_at_lengths(image, np.array([length]))
    kept = image[arc_lengths(points) < length - 1e-6]
    # The stand is as wide everywhere.
    end += (width - (end - corner) @ out)[:, None] * out
    return np.vstack([corner, kept[1:], end])


def bust_depth(piece: Piece, name: str, top_first: bool) -> float | None:
    """Return how far from the upper end of an edge its piece's bust line meets it [m]; None where it does not."""
    import shapely

    points = piece.edge(name).points
    edge = shapely.LineString(points if top_first else points[::-1])
    for line in (line for key, line in piece.internal_lines.items() if key.startswith("bust")):
        for end in line[[0, -1]]:
            if edge.distance(shapely.Point(end)) < 1e-3:
                return float(edge.project(shapely.Point(end)))
    return None
