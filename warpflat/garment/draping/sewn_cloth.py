"""The sewn cloth: flat pieces whose seams, darts and cuts are closed, as one mesh in space at rest in the plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Sized
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from warpflat.core import FloatArray, InputError, IntArray, range_offsets
from warpflat.flat import (
    Fabric,
    Flattening,
    Surface,
    border_edges,
    corner_triangles,
    grain_axes,
    join_labels,
    mesh_edges,
)
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.garment import Garment

__all__ = ["ClothPiece", "SewnCloth", "join_pieces", "piece_slices", "pieces_of", "sew_cloth", "worn_surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SewnCloth:
    """Pieces of one cloth, sewn together.

    Attributes:
        fabric: the cloth.
        designed: #V by 3, where the vertices lie on the designed surface [m].
        faces: #F by 4, of the sewn mesh, -1 in the last column of a triangle.
        flat_faces: #F by 4, the same faces in the numbering of `flat`.
        flat: #P by 2, the patterns side by side in their own numbering [m].
        welded: #P, for each vertex of the patterns its vertex of the sewn mesh.
        warp, weft: #F by 2, unit vectors of the threads in the plane.
        piece_faces: the faces of each piece.
        piece_vertices: the rows of `flat` of each piece.
        lines: feature lines and edges by "piece.line", in the numbering of the sewn mesh.
        turned: pieces that lie in `flat` turned over, mirrored at x = 0.
    """

    fabric: Fabric
    designed: FloatArray
    faces: IntArray
    flat_faces: IntArray
    flat: FloatArray
    welded: IntArray
    warp: FloatArray
    weft: FloatArray
    piece_faces: Mapping[str, slice]
    piece_vertices: Mapping[str, slice]
    lines: Mapping[str, IntArray]
    turned: frozenset[str] = frozenset()

    def cells(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Return the membrane's cells: a triangle, or the four corner triangles of a quad with half their area each.

        Returns:
            #C by 3 vertices of the sewn mesh; #C, the face of each; #C by 3 by 2, gradients of the weight of each corner
            along warp and weft [1/m]; #C, the flat area [m2].
        """
        corner, face, share = corner_triangles(self.flat_faces)
        p = self.flat[corner]
        edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=-1)
        inverse = np.linalg.inv(edges)
        along = inverse @ np.stack([self.warp[face], self.weft[face]], axis=-1)
        gradient = np.concatenate([-along.sum(axis=1, keepdims=True), along], axis=1)
        return self.welded[corner], face, gradient, 0.5 * share * np.linalg.det(edges)

    def threads(self, positions: FloatArray) -> FloatArray:
        """Return warp and weft in each cell of cloth at #V by 3 places [m], 2 by #C by 3: of length 1 without strain."""
        corner, _, gradient, _ = self.cells()
        return np.einsum("cki,ckw->wci", positions[corner], gradient)

    def edge_lengths(self) -> csr_array:
        """Return #V by #V, the lengths of the edges in the flat cloth [m], either way; without the diagonals of quads."""
        edges = mesh_edges(self.flat_faces)
        length = np.linalg.norm(self.flat[edges[:, 0]] - self.flat[edges[:, 1]], axis=1)
        joined, first = np.unique(np.sort(self.welded[edges], axis=1), axis=0, return_index=True)
        half = coo_array((length[first], tuple(joined.T)), shape=(len(self.designed),) * 2).tocsr()
        return half + half.T

    def laplacian(self) -> tuple[csr_array, FloatArray]:
        """Return the flat cloth's Laplacian, across seams too, and the bending stiffness at each vertex.

        Both ways of splitting a quad count half, so that a mirrored piece bends as its partner does. A border is free: its
        rows have no stiffness, and the vertices next to it stand for its area.

        Returns:
            #V by #V, L with cotangents as weights and an entry for any two vertices of a cell; #V, s = B a / A^2 [N/m], A the
            area of a vertex and a that which it stands for: the energy is 1/2 s |L x|^2.
        """
        corner, _, gradient, of_cell = self.cells()
        count, places = len(self.designed), (np.repeat(corner, 3, axis=1).ravel(), np.tile(corner, (1, 3)).ravel())
        values = -of_cell[:, None, None] * (gradient @ gradient.transpose(0, 2, 1))
        matrix = csr_array(coo_array((values.ravel(), places), shape=(count, count)))
        area, inside = self.vertex_areas(), np.ones(count)
        inside[border_edges(self.faces).ravel()] = 0.0
        near = csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
        takers = near @ inside
        stands_for = area + near @ (np.where(inside == 0.0, area, 0.0) / np.maximum(takers, 1.0))
        return matrix, np.asarray(self.fabric.bending * inside * stands_for / area**2)

    def vertex_areas(self) -> FloatArray:
        """Return #V, a third of the flat area of the cells at each vertex [m2]."""
        corner, _, _, area = self.cells()
        summed = np.bincount(corner.ravel(), np.repeat(area / 3.0, 3), minlength=len(self.designed))
        return summed.astype(np.float64)

    @property
    def mean_edge(self) -> float:
        """Edge of squares that would share the flat area as the vertices do [m]."""
        return float(np.sqrt(self.vertex_areas().mean()))


class ClothPiece(NamedTuple):
    """A piece of cloth: #P by 2, flat [m]; #F by 4 faces; #P by 3, in space [m]; 2, its warp; lines by name, as vertices."""

    flat: FloatArray
    faces: IntArray
    space: FloatArray
    warp: FloatArray
    lines: Mapping[str, IntArray]


def piece_slices(rows: Mapping[str, Sized]) -> dict[str, slice]:
    """Return where the rows of each piece lie when they stand one piece after the other."""
    ends = range_offsets([len(each) for each in rows.values()]).tolist()
    return dict(zip(rows, map(slice, ends[:-1], ends[1:]), strict=True))


def join_pieces(
    pieces: Mapping[str, ClothPiece],
    one: IntArray,
    other: IntArray,
    *,
    fabric: Fabric,
    turned: frozenset[str] = frozenset(),
) -> SewnCloth:
    """Sew pieces together: vertices that become one are designed to lie in the middle of their places.

    Args:
        pieces: by name.
        one, other: the vertices that are sewn to each other, where those of the pieces stand one piece after the other.
        fabric: the cloth.
        turned: the pieces that lie turned over.
    """
    vertices = piece_slices({name: piece.flat for name, piece in pieces.items()})
    faces = {name: piece.faces for name, piece in pieces.items()}
    flat_faces = np.concatenate([np.where(rows >= 0, rows + vertices[name].start, -1) for name, rows in faces.items()])
    flat = np.concatenate([piece.flat for piece in pieces.values()])
    space = np.concatenate([piece.space for piece in pieces.values()])
    welded = join_labels(len(flat), one, other)
    total = np.stack([np.bincount(welded, column) for column in space.T], axis=1)
    warp = np.repeat([piece.warp for piece in pieces.values()], [len(each) for each in faces.values()], axis=0)
    return SewnCloth(
        fabric=fabric,
        designed=total / np.bincount(welded)[:, None],
        faces=np.where(flat_faces >= 0, welded[flat_faces], -1).astype(np.int32),
        flat_faces=flat_faces.astype(np.int32),
        flat=flat,
        welded=welded,
        warp=warp,
        weft=np.column_stack([warp[:, 1], -warp[:, 0]]),
        piece_faces=piece_slices(faces),
        piece_vertices=vertices,
        lines={
            f"{name}.{line}": welded[ids + vertices[name].start]
            for name, piece in pieces.items()
            for line, ids in piece.lines.items()
        },
        turned=turned,
    )


def worn_surface(name: str, points: FloatArray, faces: IntArray) -> Surface:
    """Return a piece at places in space, #P by 3 [m], with its own faces, #F by 4 or 3."""
    quads = np.pad(faces, ((0, 0), (0, 4 - faces.shape[1])), constant_values=-1).astype(np.int32)
    return Surface(vertices=points, faces=quads, name=name)


def pieces_of(garment: Garment | Flattening | Sequence[Flattening]) -> dict[str, Flattening]:
    """Return flat pieces by their names."""
    if isinstance(garment, Garment):
        return dict(garment.pieces)
    return {piece.surface.name: piece for piece in ([garment] if isinstance(garment, Flattening) else garment)}


def sew_cloth(garment: Garment | Flattening | Sequence[Flattening]) -> SewnCloth:
    """Close the seams, darts and cuts of flat pieces.

    Args:
        garment: a garment with its seams, or flat pieces.

    Raises:
        InputError: the pieces are of different cloths, a face is mirrored, or the garment consists of half pieces.
    """
    pieces = pieces_of(garment)
    if isinstance(garment, FormGarment):
        folded = [name for name, piece in garment.form.pieces.items() if piece.fold]
        if folded:
            raise InputError(
                f"drape: piece {folded[0]} is half a piece on the fold; flatten the whole garment: half = false"
            )
    if not pieces:
        raise InputError("drape: there is no piece; give a garment or at least one flat piece")
    fabrics = {piece.fabric for piece in pieces.values()}
    if len(fabrics) > 1:
        names = " and ".join(sorted({fabric.name for fabric in fabrics})[:2])
        raise InputError(f"drape: the pieces are of different cloths ({names}); flatten them all in one")
    for name, piece in pieces.items():
        if piece.flipped_faces:
            raise InputError(f"drape: piece {name} has {piece.flipped_faces} mirrored faces; relax it to the end first")
    rows = piece_slices({name: piece.positions for name, piece in pieces.items()})
    # Pairs of vertices that are sewn together: along seams, and on the two sides of every cut.
    pairs: list[tuple[IntArray, IntArray]] = []
    for name, piece in pieces.items():
        # The sides of a cut have doubled vertices of the surface.
        _, first, which = np.unique(piece.vertex_origin, return_index=True, return_inverse=True)
        pairs.append((rows[name].start + np.arange(len(which)), rows[name].start + first[which]))
    for seam in garment.stitching if isinstance(garment, Garment) else ():
        one, other = (rows[name].start + ids for name, ids in zip(seam.pieces, seam.vertices, strict=True))
        # Sides of other vertices are sewn at their joints.
        pairs.append((one, other) if seam.joints is None else (one[seam.joints[:, 0]], other[seam.joints[:, 1]]))
    cloth = {
        name: ClothPiece(
            piece.positions, piece.faces, piece.surface.vertices[piece.vertex_origin],
            grain_axes(piece.grain_angle)[0], piece.network.surface.lines,
        )
        for name, piece in pieces.items()
    }  # fmt: skip
    one, other = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return join_pieces(cloth, one, other, fabric=next(iter(fabrics)))
