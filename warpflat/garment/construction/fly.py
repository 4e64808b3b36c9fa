"""Flies: the facing and the shield of a lapped zip that opens trousers in front, below a waistband."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from warpflat.core import InputError, part_between
from warpflat.garment.construction.edges import (
    ON,
    above_and_below,
    downwards,
    free_piece_name,
    new_piece,
    redrawn,
)
from warpflat.garment.construction.strips import folded_strip
from warpflat.pattern import Edge, Pattern, Piece, Seam

__all__ = ["with_flies"]

# Width of the facing and, where the waistband has no underlap, of the finished shield; how far both reach below the zip [m].
_WIDE, _BELOW = 0.040, 0.020


def with_flies(pattern: Pattern) -> Pattern:
    """Return a pattern with the facing and the shield of each lapped zip that begins at a waistband in front.

    The facing repeats the upper part of the front beside the zip and ends in a curve; the shield is a folded strip, as wide as the
    underlap of the waistband. Both are cut once: the facing for the half that lies above.
    """
    for seam in pattern.seams:
        zips = [each for each in seam.openings if each.kind == "zip" and each.style == "lapped" and each.begin <= 0.0]
        sides = seam.stretches
        in_front = all("front" in re.split("[ _]", side.piece) for side in sides)
        # Waistbands that are sewn to the edge above.
        above, _ = above_and_below(pattern.piece(sides[0].piece, pattern.sample), sides[0].edge)
        bands = [
            other.piece
            for joint in pattern.seams
            for own, others in (joint.sides, joint.sides[::-1])
            if any(each.place == (sides[0].piece, above) for each in own)
            for other in others
            if pattern.piece(other.piece, pattern.sample).role == "waistband"
        ]
        if zips and len(sides) == 2 and in_front and bands:
            pattern = _with_fly(pattern, seam, zips[0].begin + zips[0].length + _BELOW, bands[0])
    return pattern


def _with_fly(pattern: Pattern, seam: Seam, length: float, band: str) -> Pattern:
    import shapely

    side, (facing, shield) = seam.sides[1][0], (free_piece_name(pattern, name) for name in ("fly_facing", "fly_shield"))

    def fly(piece: Piece) -> tuple[Piece, Piece]:
        points, above = downwards(piece, side.edge)[0], above_and_below(piece, side.edge)[0]
        centre, waist = shapely.LineString(points), shapely.LineString(piece.edge(above).points)
        # As far as the facing's lower end turns to the edge in a quarter of a circle.
        along = shapely.LineString(part_between(points, 0.0, length - _WIDE))
        region = shapely.Polygon(piece.outline).intersection(along.buffer(_WIDE))
        if region.geom_type != "Polygon" or length > centre.length:
            raise InputError(f"a fly of {1e3 * length:.0f} mm finds no room along {side.piece}.{side.edge}")
        ring = np.asarray(shapely.orient_polygons(region).exterior.coords)[:-1]
        on = [shapely.distance(line, shapely.points(ring)) < ON for line in (waist, centre)]
        kinds = np.where(on[0] & np.roll(on[0], -1), 0, np.where(on[1] & np.roll(on[1], -1), 1, 2))
        first = next(k for k in range(len(ring)) if kinds[k] != kinds[k - 1])
        kinds, ring = np.roll(kinds, -first), np.roll(ring, -first, axis=0)
        ends = [k for k in range(len(ring)) if kinds[k] != kinds[k - 1]] + [len(ring)]
        closed = np.vstack([ring, ring[:1]])
        called = ("waist", "centre", "inner edge")
        edges = [
            Edge(name=called[kinds[a]], points=closed[a : b + 1], kind="cut", allowance=piece.edge(side.edge).width)
            for a, b in pairwise(ends)
        ]
        wide = next((edge.length for edge in pattern.piece(band, piece.size).edges if edge.name == "overlap"), _WIDE)
        return (
            new_piece(facing, piece, edges, "fly", grain=piece.grain),
            folded_strip(shield, piece, length, wide, role="fly", grain=(0.2, 0.5)),
        )

    return redrawn(pattern, side.piece, fly)
