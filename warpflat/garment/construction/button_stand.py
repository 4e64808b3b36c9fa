"""Cloth beyond the centre line: button stands with marked buttonholes and buttons, and wraps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, off_line, part_between, points_at_lengths, reflected
from warpflat.garment.construction.details import OpeningTable
from warpflat.garment.construction.edges import (
    backwards,
    beside,
    direction,
    downwards,
    drawn_on,
    joined,
    lines_ending_on,
    runs_down,
    trimmed,
    with_edges,
)
from warpflat.garment.construction.facings import STAND, STAND_END
from warpflat.pattern import FOLD_STRAIGHT, Edge, Piece

__all__ = ["bust_depth", "button_depths", "buttonhole", "with_button_stand", "with_wrap"]

# The first button lies this far below the edge, beside half of its own width [m], and the last at least this share of
# the spacing above the lower end.
_BELOW, _LEFT_BELOW = 0.010, 0.6
# A buttonhole is longer than the button is wide [m], and reaches so far beyond the centre, where the button's shank lies.
_THICKNESS, _SHANK = 0.003, 0.003
# Diameter of the small button on a cuff, a collar or a placket [m].
_SMALL = 0.012
# Half the length of the bars at the ends of a buttonhole [m].
_BAR = 0.004
# Allowance of the edge of a wrap, which is turned in twice [m], and the least of an edge that is left beside it.
_WRAP_HEM, _LEAST_LEFT = 0.020, 0.020


def button_depths(opening: OpeningTable, length: float, bust: float | None, count: int | None = None) -> FloatArray:
    """Return how far below the upper edge the buttons lie [m].

    Args:
        opening: with its buttons.
        length: of it [m].
        bust: depth of the bust line, on which a button lies [m]; None where it crosses none.
        count: of another size, to which this one keeps.

    Raises:
        InputError: there is no room for two buttons.
    """
    first, count = 0.5 * opening.button + _BELOW, opening.count or count
    if count is not None:
        spacing = (length - first) / max(count - 1 + _LEFT_BELOW, 1.0)
    else:
        spacing = opening.spacing
        if bust is not None and bust - first > 0.5 * spacing:
            spacing = (bust - first) / round((bust - first) / spacing)
        count = int((length - first) / spacing - _LEFT_BELOW) + 1
    if count < 2 or spacing <= opening.button:
        raise InputError(f"no room for buttons {opening.button_mm:.0f} mm wide on {1e3 * length:.0f} mm")
    return np.asarray(first + spacing * np.arange(count))


def with_button_stand(piece: Piece, name: str, opening: OpeningTable, end: float, depths: FloatArray) -> Piece:
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
    upper, edge, lower, out = _down_its_edge(piece, name, "have a button stand", end)
    top, low = edge.points[[0, -1]]
    along = direction(part_between(edge.points, 0.0, end))
    reach = _reflected(upper.points[::-1], top, out, opening.width)
    new = {upper.name: [replace(upper, points=joined(upper.points, reach))]}
    if end > edge.length - 1e-6:
        foot = _reflected(lower.points, low, out, opening.width)
        new[lower.name] = [replace(lower, points=joined(foot[::-1], lower.points))]
        below = []
    else:
        foot = top + end * along + np.outer([0.0, opening.width], out)
        rest = edge.points[arc_lengths(edge.points) > end + 1e-6]
        step = Edge(name=f"{name} {STAND_END}", points=foot[::-1])
        below = [step, replace(edge, points=np.vstack([foot[0], rest]))]
    new[name] = [Edge(name=f"{name} {STAND}", points=np.array([reach[-1], foot[-1]])), *below]
    # A mark for each button, and a line for each buttonhole across the stand.
    centres = [top + depth * along for depth in depths]
    lines = [(name, np.array([top, (top + min(end, edge.length) * along)]))]
    for centre in centres:
        ends = centre + np.outer([_SHANK, _SHANK - opening.button - _THICKNESS], out)
        bars = [("buttonhole end", end + np.outer([-_BAR, _BAR], along)) for end in ends]
        lines += [("buttonhole", ends), *bars]
    return drawn_on(_with_sides(piece, name, new), lines, [("button", centre) for centre in centres])


def with_wrap(piece: Piece, name: str, opening: OpeningTable) -> Piece:
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
    upper, edge, lower, out = _down_its_edge(piece, name, "be wrapped", np.inf)
    centre = edge.points

    def beyond(edge: Edge, line: FloatArray) -> FloatArray:
        if edge.length < opening.width + _LEAST_LEFT:
            raise InputError(
                f"{piece.name}.{edge.name} is {1e3 * edge.length:.0f} mm long up to its next corner or dart, too short for a wrap of "
                f"{1e3 * opening.width:.0f} mm"
            )
        return reflected(part_between(line, 0.0, opening.width), out, float(line[0] @ out))

    foot = beyond(lower, lower.points)
    if upper.name == "neck":
        waists = _met_by(piece, centre, "waist")
        corner = points_at_lengths(centre, waists[0]) + opening.width * out if waists else foot[-1]
        head = np.array([upper.points[0], corner])
    else:
        head = joined(upper.points, beyond(upper, upper.points[::-1]))
    new = {
        upper.name: [replace(upper, points=head)],
        name: [],
        lower.name: [replace(lower, points=joined(foot[::-1], lower.points))],
    }
    if np.linalg.norm(foot[-1] - head[-1]) > _LEAST_LEFT:
        points = np.array([head[-1], foot[-1]])
        new[name] = [Edge(name="wrap edge", points=points, kind="hem", allowance=_WRAP_HEM)]
    tie = [("tie", head[-1])] if opening.tie and (upper.name != "neck" or new[name]) else []
    wrapped = drawn_on(_with_sides(piece, name, new), [(name, centre)], tie)
    return trimmed(wrapped, wrapped.edges)


def _down_its_edge(piece: Piece, name: str, what: str, end: float) -> tuple[Edge, Edge, Edge, FloatArray]:
    """Return the edge above the straight one of a half, that itself, and the one below, walking down, and the direction beyond it.

    Raises:
        InputError: the edge is not straight down to its `end` [m], so that the piece cannot do `what`.
    """
    before, after = beside(piece, name)
    edge, down = piece.edge(name), runs_down(piece, piece.edge(name).points)
    straight = part_between(edge.points[:: 1 if down else -1], 0.0, end)[:: 1 if down else -1]
    x, y = direction(straight)
    stray = float(off_line(straight, straight[[0, -1]]).max())
    if stray > FOLD_STRAIGHT:
        raise InputError(
            f"{piece.name}.{name} strays {1e3 * stray:.1f} mm from straight and cannot {what}; constrain it, "
            f'[[constraints]] line = "{name}", straight = "warp"'
        )
    row = [replace(each, vertices=None) for each in (piece.edge(before), edge, piece.edge(after))]
    upper, edge, lower = row if down else backwards(row)
    return upper, edge, lower, np.array([y, -x])


def _with_sides(piece: Piece, name: str, new: Mapping[str, Sequence[Edge]]) -> Piece:
    """Return a piece with edges in place of others that are given as one walks down the edge of a name."""
    down = downwards(piece, name)[1]
    return with_edges(piece, {key: row if down else backwards(row) for key, row in new.items()})


def buttonhole(centre: FloatArray, along: FloatArray) -> dict[str, FloatArray]:
    """Return the lines of a buttonhole on a cuff, a collar or a waistband (2 by 2 [m] each), for a small button.

    Args:
        centre: its middle [m].
        along: its direction.
    """
    half, across = 0.5 * (_SMALL + _THICKNESS), np.array([-along[1], along[0]])
    ends = centre + np.outer([-half, half], along)
    bars = {f"buttonhole end {k}": end + np.outer([-_BAR, _BAR], across) for k, end in enumerate(ends, start=1)}
    return {"buttonhole": ends, **bars}


def _reflected(points: FloatArray, corner: FloatArray, out: FloatArray, width: float) -> FloatArray:
    """Return the mirror image of a line that begins in a corner, up to a distance beyond it (#P by 2 [m])."""
    away = np.maximum.accumulate(np.maximum(0.0, (corner - points) @ out))
    if away[-1] < width:
        raise InputError(f"an edge beside the button stand is narrower than its {1e3 * width:.0f} mm")
    image = reflected(points, out, float(corner @ out))
    image = part_between(image, 0.0, float(np.interp(width, away, arc_lengths(points))))
    # The stand is as wide everywhere.
    image[-1] += (width - (image[-1] - corner) @ out) * out
    return image


def bust_depth(piece: Piece, name: str) -> float | None:
    """Return how far from the upper end of an edge its piece's bust line meets it [m]; None where it does not."""
    return next(iter(_met_by(piece, downwards(piece, name)[0], "bust")), None)


def _met_by(piece: Piece, edge: FloatArray, level: str) -> list[float]:
    """Return how far along an edge lines of a level inside its piece end on it [m]."""
    lines = {name: line for name, line in piece.internal_lines.items() if name.startswith(level)}
    return [at for _, at in lines_ending_on(edge, lines)]
