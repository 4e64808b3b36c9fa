"""Pieces that are each other's mirror images: one is drawn and cut twice, and sewn at the seams of both."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import arc_lengths
from warpflat.pattern import Piece, Seam, SeamSide

if TYPE_CHECKING:
    from warpflat.garment.construction.garment import Garment

__all__ = ["MirrorPair", "evened", "find_mirror_pairs", "sew_mirror_pairs"]

#: Edges of a pair that is cut by one pattern agree in length, up to each of their points, within this [m].
SAME_LENGTH = 5e-5
# What rests farther [m] from the mean of itself and its mirror image is not meant to be symmetric.
_EVEN = 2.5e-4


@dataclass(frozen=True, kw_only=True)
class MirrorPair:
    """A piece that is cut by another one's pattern, turned over.

    Attributes:
        name: the piece that is not drawn.
        of: the piece that is drawn.
        edges: for each edge of the first piece, the edge of the second that is its mirror image.
    """

    name: str
    of: str
    edges: Mapping[str, str]


def evened(garment: Garment) -> Garment:
    """Return a garment with each piece as the mean of itself and its mirror image, if all pieces have one.

    A relaxation ends as far to the left or right of its symmetric rest as its tolerance leaves, some hundredths of a millimetre.
    """
    mates = {name: mate for pair in garment.pairs for name, mate in (pair, pair[::-1])}
    pieces = {}
    for name, piece in garment.pieces.items():
        mate = mates.get(name, name)
        images = garment.mirror_vertices(name, mate)
        if images is None:
            return garment
        here, there = piece.positions, garment.pieces[mate].positions[images] * [-1.0, 1.0]
        move = 0.5 * ((there - there.mean(axis=0)) - (here - here.mean(axis=0)))
        if np.abs(move).max() > _EVEN:
            return garment
        pieces[name] = replace(piece, positions=here + move)
    return replace(garment, pieces=pieces)


def find_mirror_pairs(
    garments: Mapping[str, Garment],
    pieces: Mapping[str, Sequence[Piece]],
    seams: Sequence[Seam],
    unlike: Collection[str] = (),
) -> tuple[MirrorPair, ...]:
    """Find pieces that are mirror images in every size, with equal edges, and whose seams are mirror images too.

    Args:
        garments: flattened, by size.
        pieces: their patterns, all of them.
        seams: between these.
        unlike: pieces that are going to be cut unlike their mirror images.
    """
    every = [set(garment.pairs) for garment in garments.values()]
    found: list[MirrorPair] = []
    for first, second in next(iter(garments.values())).pairs:
        if first in unlike or second in unlike or not all((first, second) in pairs for pairs in every):
            continue
        matched = [_matching_edges(garments[size], pieces[size], first, second) for size in garments]
        if matched[0] is not None and all(edges == matched[0] for edges in matched):
            found.append(MirrorPair(name=second, of=first, edges=matched[0]))
    # A piece that is sewn differently needs notches of its own; leaving it out may make others differ.
    while True:
        by_name = {pair.name: pair for pair in found}
        different = {
            part.piece
            for seam in seams
            for side in seam.sides
            for part, drawn in zip(side, _replaced(side, by_name), strict=True)
            if drawn.mirrored and _mirror_seam(drawn, seams, by_name) is None
        }
        if not different:
            return tuple(found)
        found = [pair for pair in found if pair.name not in different]


def sew_mirror_pairs(seams: Sequence[Seam], mirror_pairs: Sequence[MirrorPair]) -> tuple[Seam, ...]:
    """Replace the edges of pieces that are not drawn by those of the pieces that are.

    Such a seam runs as its mirror image does, so that the notches of one are those of the other.
    """
    by_name = {pair.name: pair for pair in mirror_pairs}
    sewn = []
    for seam in seams:
        sides = (_replaced(seam.sides[0], by_name), _replaced(seam.sides[1], by_name))
        mirrored = [side for row in sides for side in row if side.mirrored]
        if not mirrored:
            sewn.append(seam)
            continue
        image = _mirror_seam(mirrored[0], seams, by_name)
        assert image is not None  # find_mirror_pairs sees to it
        other, place = image
        ease, (first, last) = seam.ease, seam.eased
        if next(number for number in (0, 1) if mirrored[0] in sides[number]) != place:
            first, last = (seam.reach(share, 1.0) / (1.0 + ease) for share in (first, last))
            sides, ease = (sides[1], sides[0]), 1.0 / (1.0 + ease) - 1.0
        there = next(side for side in other.sides[place] if _key(side) == _key(mirrored[0]))
        if there.reversed != mirrored[0].reversed:
            sides = (_reversed_side(sides[0]), _reversed_side(sides[1]))
            first, last = 1.0 - last, 1.0 - first
        notches = None if seam.notches is None else tuple(at for at in (first, last) if 0.0 < at < 1.0)
        sewn.append(replace(seam, sides=sides, ease=ease, eased=(first, last), notches=notches))
    return tuple(sewn)


def _matching_edges(garment: Garment, pieces: Sequence[Piece], first: str, second: str) -> dict[str, str] | None:
    """Return the first piece's edge for each of the second's; None if one pattern does not serve for both."""
    one, two = (next(piece for piece in pieces if piece.name == name) for name in (first, second))
    partners = garment.mirror_vertices(first, second)
    edges: dict[str, str] = {}
    for edge in one.edges:
        if partners is None or edge.vertices is None:
            return None
        row = partners[np.asarray(edge.vertices)][::-1]
        image = next((e for e in two.edges if e.vertices is not None and np.array_equal(e.vertices, row)), None)
        if image is None or (image.kind, image.width) != (edge.kind, edge.width):
            return None
        if np.abs(arc_lengths(image.points[::-1]) - arc_lengths(edge.points)).max() > SAME_LENGTH:
            return None
        edges[image.name] = edge.name
    return edges if len(edges) == len(two.edges) else None


def _mirror_seam(
    side: SeamSide, seams: Sequence[Seam], mirror_pairs: Mapping[str, MirrorPair]
) -> tuple[Seam, int] | None:
    """Return the seam at which the drawn edge is sewn itself, and the side of it."""
    for seam in seams:
        for number in (0, 1):
            if any(part.piece not in mirror_pairs and _key(part) == _key(side) for part in seam.sides[number]):
                return seam, number
    return None


def _replaced(side: Sequence[SeamSide], mirror_pairs: Mapping[str, MirrorPair]) -> tuple[SeamSide, ...]:
    """Replace the edges of pieces that are not drawn."""
    return tuple(
        SeamSide(
            piece=mirror_pairs[part.piece].of,
            edge=mirror_pairs[part.piece].edges[part.edge],
            reversed=not part.reversed,
            mirrored=True,
        )
        if part.piece in mirror_pairs
        else part
        for part in side
    )


def _reversed_side(side: Sequence[SeamSide]) -> tuple[SeamSide, ...]:
    """Return a side of a seam, run the other way."""
    return tuple(replace(part, reversed=not part.reversed) for part in reversed(side))


def _key(side: SeamSide) -> tuple[str, str]:
    return side.piece, side.edge
