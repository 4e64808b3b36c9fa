"""Facings of free edges: pieces that repeat an edge and a strip along it, joined as the pieces themselves are.

The facing of a button stand may be grown on: then it is the mirror image of that strip beyond the stand's edge, on which the
cloth is folded.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    arc_lengths,
    part_between,
    polyline_length,
    reflected,
    without_side,
)
from warpflat.garment.construction.edges import (
    Place,
    beside,
    direction,
    drawn_on,
    free_piece_name,
    joined,
    new_piece,
    redrawn,
    sewn,
    up_and_across,
    with_edges,
)
from warpflat.pattern import Edge, Pattern, Piece, SeamSide

__all__ = [
    "INNER", "STAND", "STAND_END", "Stand", "centre_notch", "is_beside", "sewn_alike", "sewn_inside", "strip_along", "strip_piece",
    "with_facings", "with_stand_facings",
]  # fmt: skip

#: What the outer edge and the lower end of a button stand are called, after its line, and the inner edge of a facing.
STAND, STAND_END, INNER = "button stand", "stand end", "inner edge"
# The inner edge of a facing is rounded where its edges meet [m].
_ROUND = 0.030


@dataclass(frozen=True, kw_only=True)
class Stand:
    """The outer edge of a button stand, to be faced.

    Attributes:
        piece, edge: names.
        grown_on: whether the facing is folded, not sewn.
        width: of the facing [m].
    """

    piece: str
    edge: str
    grown_on: bool
    width: float


def with_facings(
    pattern: Pattern,
    places: Sequence[Place],
    width: float,
    *,
    gaps: Collection[str] = (),
    stands: Sequence[Stand] = (),
) -> Pattern:
    """Return a pattern with a facing along each of some free edges, joined as the pieces themselves are.

    A button stand beside one of the edges is faced by the same piece, and so is a keyhole.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: [m].
        gaps: names of seams that an opening leaves open at their upper end; the facing's ends are turned in there.
        stands: of the pattern.

    Raises:
        InputError: a dart ends in an edge, or the facing would not lie within the piece.
    """
    parts, shell = dict[Place, SeamSide](), pattern
    for name, edge in places:
        title = free_piece_name(pattern, f"{name}_{edge}_facing".replace(" ", "_"))
        stand = next((each for each in stands if is_beside(shell, each, (name, edge))), None)
        sample = shell.piece(name, shell.sample)
        chain = [edge] if stand is None else [edge, stand.edge]
        chain = chain[::-1] if stand is not None and beside(sample, edge)[0] == stand.edge else chain
        grown_on = stand is not None and stand.grown_on
        pattern = _faced(pattern, name, chain, width, title, stand)
        for each in (edge, *beside(sample, *chain)):
            on_facing = SeamSide(piece=title, edge=each)
            parts[name, each] = SeamSide(piece=name, edge=f"facing {each}", reversed=True) if grown_on else on_facing
        side = SeamSide(piece=name, edge=edge)
        pattern = sewn(pattern, title, side, parts[name, edge], notches=centre_notch(sample))
        if stand is not None and not grown_on:
            side = replace(side, edge=stand.edge)
            pattern = sewn(pattern, f"{name} {stand.edge} facing", side, replace(side, piece=title))
    return sewn_alike(pattern, shell, parts, gaps, f"{places[0][1]} facing")


def sewn_alike(
    pattern: Pattern, shell: Pattern, parts: Mapping[Place, SeamSide], gaps: Collection[str], of: str
) -> Pattern:
    """Return a pattern whose strips are sewn to each other where their pieces are.

    Args:
        pattern: with the strips.
        shell: the pattern without them.
        parts: by edge of the shell what lies along it, reversed if that runs the other way.
        gaps: names of seams that an opening leaves open there.
        of: what the strips are called.
    """
    for seam in shell.seams:
        both = [row[0] for row in seam.sides]
        # Of halves on the fold one seam is listed for both sides, and just one of them has the opening.
        centre, on_fold = (
            both[0].piece == both[1].piece,
            any(shell.piece(side.piece, shell.sample).on_fold for side in both),
        )
        is_open = seam.name in gaps and (centre or not on_fold)
        # A dart that ends in the seam parts a side of it; the strip lies along the part that is nearest.
        along = [[(side, parts[side.place]) for side in row if side.place in parts] for row in seam.sides]
        if not is_open and all(len(row) == 1 for row in along):
            sides = [
                replace(side, piece=part.piece, edge=part.edge, reversed=side.reversed != part.reversed)
                for ((side, part),) in along
            ]
            pattern = sewn(pattern, f"{seam.name} of {of}", sides[0], sides[1])
    return pattern


def with_stand_facings(pattern: Pattern, stands: Sequence[Stand]) -> Pattern:
    """Return a pattern with a straight facing along each button stand, which ends raw at its upper and lower end."""
    for stand in stands:
        # "front_left_centre" and "centre front button stand" make "front_left_centre_facing".
        known = stand.piece.split("_")
        known += [word for word in stand.edge.removesuffix(f" {STAND}").split(" ") if word not in known]
        title = "_".join([*known, "facing"])
        pattern = _faced(pattern, stand.piece, [stand.edge], stand.width, title, stand, sewn_in=False)
        if not stand.grown_on:
            side = SeamSide(piece=stand.piece, edge=stand.edge)
            pattern = sewn(pattern, title, side, replace(side, piece=title))
    return pattern


def _faced(
    pattern: Pattern,
    name: str,
    chain: Sequence[str],
    width: float,
    title: str,
    stand: Stand | None,
    *,
    sewn_in: bool = True,
) -> Pattern:
    """Return a pattern with the facing of a piece along some of its edges: folded along its button stand, or a piece of its own."""

    def faced(piece: Piece) -> Piece:
        around = piece.internal_lines.get("keyhole") if sewn_in else None
        strip = strip_along(piece, chain, width, around=around)
        if stand is not None and stand.grown_on:
            # The facing is grown on: the mirror image beyond an edge, which becomes a fold line inside.
            at = [edge.name for edge in strip].index(stand.edge)
            line = strip[at].points[[0, -1]]
            x, y = direction(line)
            out = np.array([-y, x])
            images = [
                replace(
                    edge, name=f"facing {edge.name}", kind=edge.kind if sewn_in or edge.kind != "seam" else "cut",
                    points=reflected(edge.points[::-1], out, float(line[0] @ out)), allowance=edge.width, vertices=None,
                )
                for edge in [*strip[:at][::-1], *strip[at + 1 :][::-1]]
            ]  # fmt: skip
            # Corners are shared bit for bit.
            images[0].points[0], images[-1].points[-1] = line[0], line[1]
            for one, other in pairwise(images):
                other.points[0] = one.points[-1]
            return drawn_on(with_edges(piece, {stand.edge: images}), [("fold line", line)])
        return strip_piece(piece, strip, title, "facing")

    return redrawn(pattern, name, faced)


def centre_notch(piece: Piece) -> tuple[float, ...] | None:
    """Return the notch in the middle of an edge that crosses the centre line; None where the piece has one side only.

    Such pieces may be printed half, each on its own: just a notch on the fold is then the same on all of them.
    """
    whole = without_side(piece.name) == piece.name.replace("_", " ") and not piece.on_fold
    return (0.5,) if whole else None


def is_beside(pattern: Pattern, stand: Stand, place: Place) -> bool:
    """Return whether a button stand lies beside an edge of its piece, at one of its ends."""
    return stand.piece == place[0] and stand.edge in beside(pattern.piece(stand.piece, pattern.sample), place[1])


def strip_along(piece: Piece, chain: Sequence[str], width: float, *, around: FloatArray | None = None) -> list[Edge]:
    """Return the outline of a strip along some edges, as of a facing: with as much of both neighbours as it is wide.

    Args:
        piece: that is faced.
        chain: names of edges that follow each other.
        width: [m].
        around: #P by 2 [m], a line inside that the facing reaches around by half of its width.

    Returns:
        The edges of the chain, the part of the edge after it, the inner edge, the part of the edge before it.

    Raises:
        InputError: a dart ends in the chain, or a neighbour is shorter than the facing is wide.
    """
    import shapely

    where = f"{piece.name}.{chain[0]}"
    edges, (before, after) = [piece.edge(name) for name in chain], (piece.edge(name) for name in beside(piece, *chain))
    if "dart" in (before.kind, after.kind):
        raise InputError(f"a dart ends in {where}: give it a band or a binding instead of a facing")
    # Where a stand ends above the hem, its facing ends straight across.
    ends = []
    for line, name, edge in ((before.points[::-1], before.name, edges[0]), (after.points, after.name, edges[-1])):
        if name.endswith(STAND_END):
            line = np.array([line[0], line[0] + (width + 1e-3) * direction(line)])
        if polyline_length(line) <= width:
            raise InputError(f"the edges beside {where} are shorter than the facing is wide")
        length = width
        if edge.name.endswith(STAND):
            # Up to that distance from a button stand.
            x, y = direction(edge.points)
            away = np.maximum.accumulate(np.abs((line - edge.points[0]) @ [-y, x]))
            if away[-1] <= width:
                raise InputError(f"the edges beside {edge.name} are shorter than the facing is wide")
            length = float(np.interp(width, away, arc_lengths(line)))
        ends.append(part_between(line, 0.0, length))
    first, last = ends[0][::-1], ends[1]
    line = joined(*(edge.points for edge in edges))
    rounding = _ROUND if len(edges) > 1 else 0.0
    offset = shapely.LineString(line).offset_curve(width + rounding)
    inner = np.asarray((offset.offset_curve(-rounding) if rounding else offset).coords)[::-1]
    body = shapely.Polygon(piece.outline)
    # Near the corners the line leads to where the neighbours end.
    near = np.minimum(*(np.linalg.norm(inner - end, axis=1) for end in (last[-1], first[0])))
    inner = inner[(near > 0.25 * width) & shapely.contains(body, shapely.points(inner))]
    inner = np.vstack([last[-1:], inner, first[:1]])
    if around is not None:
        # The inner edge of a facing that is made larger around a line.
        outline = joined(line, last, inner, first)[:-1]
        tongue = shapely.LineString(around).buffer(0.6 * width)
        # Rounded where the tongue leaves the strip.
        whole = shapely.union_all([shapely.Polygon(outline), tongue]).buffer(_ROUND).buffer(-_ROUND)
        ring = np.asarray(shapely.orient_polygons(whole).exterior.coords)[:-1]
        start, end = (int(np.linalg.norm(ring - point, axis=1).argmin()) for point in (inner[0], inner[-1]))
        count = (end - start) % len(ring)
        inner = np.vstack([inner[:1], np.roll(ring, -start, axis=0)[1:count], inner[-1:]])
    return [
        *(replace(edge, vertices=None) for edge in edges),
        replace(after, points=last, vertices=None),
        Edge(name=INNER, points=inner, kind="cut"),
        replace(before, points=first, vertices=None),
    ]


def sewn_inside(edges: Sequence[Edge]) -> list[Edge]:
    """Return the edges of a strip with its inner edge as a seam."""
    return [replace(edge, kind="seam", allowance=None) if edge.name == INNER else edge for edge in edges]


def strip_piece(piece: Piece, edges: Sequence[Edge], title: str, role: str, **other: Any) -> Piece:
    """Return a strip along edges of a piece as a piece of its own.

    Args:
        piece: along whose edges it lies.
        edges: as :func:`strip_along` returns them.
        title, role: of the new piece.
        other: more of its attributes, in place of those of the piece.
    """
    try:
        inner = next(edge for edge in edges if edge.name == INNER)
        middle = np.concatenate([edges[0].points, inner.points]).mean(axis=0)
        same = {
            "quantity": piece.quantity, "paired": piece.paired,
            "grain": middle + np.outer([-0.02, 0.02], up_and_across(piece)[0]),
            "internal_lines": {key: line for key, line in piece.internal_lines.items() if key.startswith("keyhole")},
        }  # fmt: skip
        return new_piece(title, piece, edges, role, **{**same, **other})
    except InputError:
        raise InputError(f"no {role} can be drawn along {piece.name}.{edges[0].name}: make it narrower") from None
