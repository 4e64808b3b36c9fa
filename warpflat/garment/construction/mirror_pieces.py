"""Pieces that are each other's mirror images: one is drawn and cut twice, and sewn at the seams of both."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, arc_lengths
from warpflat.garment.construction.edges import SAME_LINE
from warpflat.garment.construction.equal_pieces import Copy, drawn_sides, run_back
from warpflat.garment.construction.mirror import mirror_plane
from warpflat.pattern import Pattern, Piece, Seam, SeamSide

if TYPE_CHECKING:
    from warpflat.garment.construction.garment import Garment

__all__ = ["draw_pairs_once"]

# A plane of symmetry whose normal has this cosine to x at least is that between left and right.
_UPRIGHT = 0.8


def draw_pairs_once(
    pattern: Pattern, garments: Mapping[str, Garment], unlike: Collection[str] = ()
) -> tuple[Pattern, tuple[str, ...]]:
    """Return the pattern with one piece drawn for two that are mirror images, and a note on each such piece.

    They hang about x = 0, the plane at which what is cut turned over is mirrored. A mesh may stand beside that plane, and lean; one that
    faces sideways is left as it is.

    Args:
        pattern: all pieces and seams.
        garments: flattened, by size.
        unlike: pieces that are going to be cut unlike their mirror images.
    """
    from scipy.spatial.transform import Rotation

    # Mirror images in every size, with equal edges, and with seams that are mirror images too.
    every = [set(garment.pairs) for garment in garments.values()]
    copies: dict[str, Copy] = {}
    for first, second in next(iter(garments.values())).pairs:
        if first in unlike or second in unlike or not all((first, second) in known for known in every):
            continue
        matched = [_matching_edges(garments[size], pattern.pieces[size], first, second) for size in garments]
        if matched[0] is not None and all(edges == matched[0] for edges in matched):
            copies[second] = Copy(of=first, edges=matched[0], turned=True)
    # A piece that is sewn differently needs notches of its own; leaving it out may make others differ.
    different = {""}
    while different:
        different = {
            part.piece
            for seam in pattern.seams
            for part in seam.stretches
            if part.piece in copies and _mirror_seam(copies[part.piece].drawn(part), pattern.seams, copies) is None
        }
        copies = {name: copy for name, copy in copies.items() if name not in different}
    if not copies:
        return pattern, ()
    (garment, *_), points, images = garments.values(), list[FloatArray](), list[FloatArray]()
    for name, copy in copies.items():
        _, partners = garment.images[copy.of]
        points.append(garment.pieces[copy.of].network.surface.vertices)
        images.append(garment.pieces[name].network.surface.vertices[partners])
    normal, off = mirror_plane(np.concatenate(points), np.concatenate(images))
    turn = Rotation.align_vectors([1.0, 0.0, 0.0], normal)[0].as_matrix() if normal[0] > _UPRIGHT else None
    twice = {copy.of for copy in copies.values()}

    def drawn(piece: Piece) -> Piece:
        if turn is not None and piece.placement is not None:
            hung = turn @ piece.placement - np.outer([off, 0.0, 0.0], [0.0, 0.0, 1.0])
            piece = replace(piece, placement=hung)
        return replace(piece, quantity=2 * piece.quantity) if piece.name in twice else piece

    pieces = {size: [drawn(piece) for piece in row if piece.name not in copies] for size, row in pattern.pieces.items()}
    notes = tuple(f"{copy.of}: cut twice, once mirrored, it serves for {name} too" for name, copy in copies.items())
    # Edges of pieces that are drawn take the place of others. Such a seam runs as its mirror image does, so that the notches of one are
    # those of the other.
    sewn = []
    for seam in pattern.seams:
        sides = drawn_sides(seam, copies)
        mirrored = [side for row in sides for side in row if side.mirrored]
        if not mirrored:
            sewn.append(seam)
            continue
        image = _mirror_seam(mirrored[0], pattern.seams, copies)
        assert image is not None  # pieces whose seams have none are drawn
        other, place = image
        ease, (begin, end) = seam.ease, seam.eased
        if next(number for number in (0, 1) if mirrored[0] in sides[number]) != place:
            begin, end = (seam.reach(share, 1.0) / (1.0 + ease) for share in (begin, end))
            sides, ease = (sides[1], sides[0]), 1.0 / (1.0 + ease) - 1.0
        there = next(side for side in other.sides[place] if side.place == mirrored[0].place)
        if there.reversed != mirrored[0].reversed:
            sides = (run_back(sides[0]), run_back(sides[1]))
            begin, end = 1.0 - end, 1.0 - begin
        notches = None if seam.notches is None else tuple(at for at in (begin, end) if 0.0 < at < 1.0)
        sewn.append(replace(seam, sides=sides, ease=ease, eased=(begin, end), notches=notches))
    return replace(pattern, pieces=pieces, seams=tuple(sewn)), notes


def _matching_edges(garment: Garment, pieces: Sequence[Piece], first: str, second: str) -> dict[str, str] | None:
    """Return the first piece's edge for each of the second's; None if one pattern does not serve for both."""
    one, two = (next(piece for piece in pieces if piece.name == name) for name in (first, second))
    _, partners = garment.images[first]
    edges: dict[str, str] = {}
    for edge in one.edges:
        if edge.vertices is None:
            return None
        row = partners[np.asarray(edge.vertices)][::-1]
        image = next((e for e in two.edges if e.vertices is not None and np.array_equal(e.vertices, row)), None)
        if image is None or (image.kind, image.width) != (edge.kind, edge.width):
            return None
        if np.abs(arc_lengths(image.points[::-1]) - arc_lengths(edge.points)).max() > SAME_LINE:
            return None
        edges[image.name] = edge.name
    return edges if len(edges) == len(two.edges) else None


def _mirror_seam(side: SeamSide, seams: Sequence[Seam], copies: Mapping[str, Copy]) -> tuple[Seam, int] | None:
    """Return the seam at which the drawn edge is sewn itself, and the side of it."""
    for seam in seams:
        for number in (0, 1):
            if any(part.piece not in copies and part.place == side.place for part in seam.sides[number]):
                return seam, number
    return None
