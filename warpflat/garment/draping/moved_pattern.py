"""A pattern whose vertices move: the lengths of its seams' edges, the areas of its cells, and the garment with the new pattern."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from warpflat.core import FloatArray, IntArray, reflected, turned_left, unit
from warpflat.flat import Flattening, SpringNetwork, border_edges, corner_triangles, signed_cell_areas
from warpflat.garment.construction.garment import Garment
from warpflat.garment.draping.lift import Lift, surface_lift
from warpflat.garment.draping.sewn_cloth import SewnCloth, pieces_of
from warpflat.pattern import MIRRORED, Pattern, Piece

__all__ = [
    "cell_matrix",
    "edge_lengths",
    "hold_seams",
    "largest_share",
    "moved_outlines",
    "seam_differences",
    "seam_edges",
    "with_pattern",
]

# No cell shrinks below this share of its area in a step.
_LEAST_AREA = 0.5
# Weight of equal changes on both sides of a seam, over the threads' stiffness; and of what holds a piece as a whole.
_SEAM, _HOLD = 1e3, 1e-8


def seam_edges(cloth: SewnCloth) -> IntArray:
    """Return the edges of the outlines that are sewn together, #S by 2 edges by 2 vertices of `flat` in corresponding order."""
    edges = np.sort(border_edges(cloth.flat_faces), axis=1)
    sewn = cloth.welded[edges]
    turned = sewn[:, 0] > sewn[:, 1]
    edges[turned], sewn[turned] = edges[turned][:, ::-1], sewn[turned][:, ::-1]
    # Of the two edges of a seam that with the lower vertices comes first.
    order = np.lexsort((*np.sort(edges, axis=1).T[::-1], sewn[:, 1], sewn[:, 0]))
    same = (sewn[order][1:] == sewn[order][:-1]).all(axis=1) & (sewn[order][1:, 0] != sewn[order][1:, 1])
    first = np.flatnonzero(same)
    return np.stack([edges[order[first]], edges[order[first + 1]]], axis=1)


def edge_lengths(flat: FloatArray, edges: IntArray) -> FloatArray:
    """Return the lengths of edges (#E by 2) [m]."""
    return np.asarray(np.linalg.norm(flat[edges[:, 1]] - flat[edges[:, 0]], axis=1))


def seam_differences(flat: FloatArray, seams: IntArray) -> FloatArray:
    """Return #S, the difference in length of the two sides of seams [m]."""
    return edge_lengths(flat, seams[:, 0]) - edge_lengths(flat, seams[:, 1])


def hold_seams(cloth: SewnCloth, seams: IntArray, difference: FloatArray) -> tuple[csr_array, FloatArray]:
    """Return a stiffness of the flat vertices (2 #P by 2 #P) and the forces (2 #P) that give the sides of seams their wanted difference.

    Each piece as a whole is held, too, softly.

    Args:
        cloth: whose flat vertices move.
        seams: see `seam_edges`.
        difference: #S [m].
    """
    flat, threads = cloth.flat, 0.5 * (cloth.fabric.stiffness_warp + cloth.fabric.stiffness_weft)
    # The change of the difference by the displacement of the vertices, #S by 2 #P.
    along = unit(flat[seams[:, :, 1]] - flat[seams[:, :, 0]]) * [[1.0], [-1.0]]
    values, columns = np.stack([-along, along], axis=2), 2 * seams[..., None] + np.arange(2)
    places = (np.repeat(np.arange(len(seams)), 8), columns.ravel())
    change = coo_array((values.ravel(), places), shape=(len(seams), 2 * len(flat))).tocsr()
    matrix = _SEAM * (change.T @ change) + diags_array(np.full(2 * len(flat), _HOLD))
    return threads * matrix, _SEAM * threads * (change.T @ (difference - seam_differences(flat, seams)))


def cell_matrix(blocks: FloatArray, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> csr_array:
    """Return the sum of cells' blocks, #C by corners and coordinates of a row by those of a column, as a matrix."""
    of_rows = np.broadcast_to(rows[:, :, :, None, None], blocks.shape)
    of_columns = np.broadcast_to(columns[:, None, None], blocks.shape)
    return csr_array(coo_array((blocks.ravel(), (of_rows.ravel(), of_columns.ravel())), shape=shape))


def largest_share(cloth: SewnCloth, step: FloatArray) -> float:
    """Return the largest share of a step, of 1, 1/2, 1/4 ..., that leaves every cell enough of its area."""
    corner, _, _ = corner_triangles(cloth.flat_faces)
    before, share = signed_cell_areas(corner, cloth.flat), 1.0
    while share > 1e-3 and (signed_cell_areas(corner, cloth.flat + share * step) < _LEAST_AREA * before).any():
        share *= 0.5
    return share


def moved_outlines(pattern: Pattern, size: str, before: SewnCloth, after: SewnCloth) -> Pattern:
    """Return a pattern of one size whose pieces have moved as the flat cloth that was meshed from them.

    Halves on the fold move evenly on both sides of it, and pieces that are cut in pairs alike.

    Args:
        pattern: of outlines.
        size: that was meshed.
        before, after: the cloth, whose pieces are those of :func:`warpflat.pattern.drafting.whole_pieces.whole_pieces`.
    """

    def mover(name: str) -> Lift:
        rows = before.piece_vertices[name]
        across = [-1.0, 1.0] if name in before.turned else [1.0, 1.0]
        triangles = before.flat_faces[before.piece_faces[name], :3] - rows.start
        return surface_lift((after.flat[rows] - before.flat[rows]) * across, before.flat[rows] * across, triangles)

    def moved(piece: Piece) -> Piece:
        if piece.name not in before.piece_vertices:
            return piece
        own, fold = mover(piece.name), next((edge.points for edge in piece.edges if edge.kind == "fold"), None)
        other, normal, offset = own, np.zeros(2), 0.0
        if fold is not None:
            normal = turned_left(unit(fold[[-1]] - fold[[0]]))[0]
            offset = float(fold[0] @ normal)
        elif piece.name + MIRRORED in before.piece_vertices:
            other, normal = mover(piece.name + MIRRORED), np.array([1.0, 0.0])

        def go(points: FloatArray) -> FloatArray:
            return points + 0.5 * (own(points) + reflected(other(reflected(points, normal, offset)), normal))

        return replace(
            piece, edges=[replace(edge, points=go(edge.points), vertices=None) for edge in piece.edges],
            holes=[replace(hole, points=go(hole.points)) for hole in piece.holes],
            internal_lines={name: go(line) for name, line in piece.internal_lines.items()},
            marks={name: go(point[None])[0] for name, point in piece.marks.items()},
        )  # fmt: skip

    return replace(pattern, pieces={size: [moved(piece) for piece in pattern.pieces[size]]}, sample_size=size)


def with_pattern(garment: Garment | Flattening, cloth: SewnCloth) -> Garment | Flattening:
    """Return the garment, or the piece, with the flat pieces of sewn cloth, and in that cloth's fabric."""
    pieces = {}
    for name, piece in pieces_of(garment).items():
        flat, network = cloth.flat[cloth.piece_vertices[name]], piece.network
        if cloth.fabric is not piece.fabric:
            # What is measured of the piece is measured in its cloth.
            network = SpringNetwork.build(
                network.surface, cloth.fabric, flat, grain_angle=piece.grain_angle, device=network.device,
                model="membrane" if network.model == "membrane" else None, stretch=network.stretch,
            )  # fmt: skip
        pieces[name] = replace(piece, positions=flat, fabric=cloth.fabric, network=network)
    return replace(garment, pieces=pieces) if isinstance(garment, Garment) else next(iter(pieces.values()))
