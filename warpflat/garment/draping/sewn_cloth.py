"""The sewn cloth: flat pieces whose seams, darts and cuts are closed, as one mesh in space at rest in the plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array

from warpflat.core import FloatArray, InputError, IntArray
from warpflat.flat import Fabric, Flattening, corner_triangles, grain_axes, join_labels
from warpflat.garment.construction.darts import dart_pairs
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.garment import Garment
from warpflat.pattern import outline_edges

__all__ = ["SewnCloth", "sew_cloth"]

Seam = tuple[tuple[str, str], tuple[IntArray, IntArray]]


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
            #C by 3 vertices of the sewn mesh; #C, the face of each; #C by 4, gradients of the weight of corner 1 along
            warp and weft, then of corner 2 [1/m]; #C, the flat area [m2].
        """
        corner, face, share = corner_triangles(self.flat_faces)
        p = self.flat[corner]
        edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=-1)
        inverse = np.linalg.inv(edges)
        along = [np.einsum("ckj,cj->ck", inverse, axis[face]) for axis in (self.warp, self.weft)]
        gradient = np.stack([along[0][:, 0], along[1][:, 0], along[0][:, 1], along[1][:, 1]], axis=1)
        return self.welded[corner], face, gradient, 0.5 * share * np.linalg.det(edges)

    def laplacian(self) -> tuple[csr_array, FloatArray]:
        """Return the flat cloth's Laplacian, across seams too, and the bending stiffness at each vertex.

        Both ways of splitting a quad count half, so that a mirrored piece bends as its partner does. A border is free: its
        rows have no stiffness, and the vertices next to it stand for its area.

        Returns:
            #V by #V, L with cotangents as weights; #V, s = B a / A^2 [N/m], A the area of a vertex and a that which it
            stands for: the energy is 1/2 s |L x|^2.
        """
        corner, _, share = corner_triangles(self.flat_faces)
        p, count = self.flat[corner], len(self.designed)
        rows, columns, values = [], [], []
        for k in range(3):
            a, b = p[:, (k + 1) % 3] - p[:, k], p[:, (k + 2) % 3] - p[:, k]
            cotangent = np.einsum("ij,ij->i", a, b) / np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
            i, j, w = self.welded[corner[:, (k + 1) % 3]], self.welded[corner[:, (k + 2) % 3]], 0.5 * share * cotangent
            rows += [i, j, i, j]
            columns += [j, i, i, j]
            values += [w, w, -w, -w]
        places = (np.concatenate(rows), np.concatenate(columns))
        matrix = csr_array(coo_array((np.concatenate(values), places), shape=(count, count)))
        area, inside = self.vertex_areas(), np.ones(count)
        inside[outline_edges(self.faces).ravel()] = 0.0
        near = csr_array(coo_array((np.ones(len(places[0])), places), shape=(count, count)))
        near.data[:] = 1.0
        takers = near @ inside
        stands_for = area + near @ (np.where(inside == 0.0, area, 0.0) / np.maximum(takers, 1.0))
        return matrix, np.asarray(self.fabric.bending * inside * stands_for / area**2)

    def vertex_areas(self) -> FloatArray:
        """Return #V, a third of the flat area of the cells at each vertex [m2]."""
        corner, _, _, area = self.cells()
        summed = np.bincount(corner.ravel(), np.repeat(area / 3.0, 3), minlength=len(self.designed))
        return summed.astype(np.float64)


def sew_cloth(garment: Garment | Flattening | Sequence[Flattening], *, seams: Sequence[Seam] = ()) -> SewnCloth:
    """Close the seams, darts and cuts of flat pieces.

    Args:
        garment: a garment with the seams of its form, or flat pieces.
        seams: further seams, each the names of two pieces and their vertices in corresponding order.

    Raises:
        InputError: the pieces are of different cloths, a face is mirrored, or the garment consists of half pieces.
    """
    if isinstance(garment, Garment):
        pieces = dict(garment.pieces)
        if isinstance(garment, FormGarment):
            folded = [name for name, piece in garment.form.pieces.items() if piece.fold]
            if folded:
                raise InputError(
                    f"drape: piece {folded[0]} is half a piece on the fold; flatten the whole garment: half = false"
                )
            runs = [(seam.pieces, run.vertices) for seam in garment.form.seams for run in seam.runs]
            seams = [*runs, *((pair.pieces, pair.vertices) for pair in dart_pairs(garment.form)), *seams]
    else:
        given = [garment] if isinstance(garment, Flattening) else list(garment)
        pieces = {piece.surface.name: piece for piece in given}
    if not pieces:
        raise InputError("drape: there is no piece; give a garment or at least one flat piece")
    fabrics = {piece.fabric for piece in pieces.values()}
    if len(fabrics) > 1:
        names = " and ".join(sorted({fabric.name for fabric in fabrics})[:2])
        raise InputError(f"drape: the pieces are of different cloths ({names}); flatten them all in one")
    for name, piece in pieces.items():
        if piece.flipped_faces:
            raise InputError(f"drape: piece {name} has {piece.flipped_faces} mirrored faces; relax it to the end first")
    counts = [len(piece.positions) for piece in pieces.values()]
    begins = dict(zip(pieces, np.concatenate([[0], np.cumsum(counts)])[:-1].tolist(), strict=True))
    # Pairs of vertices that are sewn together: along seams, and on the two sides of every cut.
    pairs: list[tuple[IntArray, IntArray]] = []
    of_surface: dict[str, IntArray] = {}
    for name, piece in pieces.items():
        origin = piece.vertex_origin
        first = np.full(len(piece.surface.vertices), -1, dtype=np.int32)
        first[origin[::-1]] = np.arange(len(origin), dtype=np.int32)[::-1]
        of_surface[name] = first + np.int32(begins[name])
        # The sides of a cut have doubled vertices of the surface.
        pairs.append((np.arange(len(origin), dtype=np.int32) + np.int32(begins[name]), of_surface[name][origin]))
    for (one, other), sides in seams:
        pairs.append((of_surface[one][sides[0]], of_surface[other][sides[1]]))
    welded = join_labels(sum(counts), np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs]))
    flat = np.concatenate([piece.positions for piece in pieces.values()])
    space = np.concatenate([piece.surface.vertices[piece.vertex_origin] for piece in pieces.values()])
    designed = np.empty((int(welded.max()) + 1, 3))
    designed[welded[::-1]] = space[::-1]
    flat_faces = np.concatenate(
        [np.where(piece.faces >= 0, piece.faces + begins[name], -1) for name, piece in pieces.items()]
    ).astype(np.int32)
    sizes = [len(piece.faces) for piece in pieces.values()]
    ends = np.cumsum([0, *sizes]).tolist()
    axes = [grain_axes(piece.grain_angle) for piece in pieces.values()]
    return SewnCloth(
        fabric=next(iter(pieces.values())).fabric,
        designed=designed,
        faces=np.where(flat_faces >= 0, welded[flat_faces], -1).astype(np.int32),
        flat_faces=flat_faces,
        flat=flat,
        welded=welded,
        warp=np.repeat([warp for warp, _ in axes], sizes, axis=0),
        weft=np.repeat([weft for _, weft in axes], sizes, axis=0),
        piece_faces={name: slice(ends[k], ends[k + 1]) for k, name in enumerate(pieces)},
        piece_vertices={name: slice(begins[name], begins[name] + counts[k]) for k, name in enumerate(pieces)},
        lines={
            f"{name}.{line}": welded[ids + begins[name]]
            for name, piece in pieces.items()
            for line, ids in piece.network.surface.lines.items()
        },
    )
