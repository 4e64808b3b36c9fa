"""Tapes around a body, and what the pieces of a form have along the same rows of the grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, IntArray, segment_lengths
from warpflat.flat import SKIN_LENGTH, half_edges_of
from warpflat.garment.mannequin.slicer import UP, plane_axes

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.layout import Layout

__all__ = ["ALONG", "PieceEdges", "RowEdges", "Tape", "stretch_tape"]

#: The axis of a tape which follows its line wherever that rises.
ALONG = np.zeros(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class RowEdges:
    """The edges of pieces that lie along a closed row of the grid.

    Attributes:
        ends: by piece, #E by 2, its vertices.
        column: by piece, #E, the edge of the row, counted from its first vertex.
        shares: by piece, #E, by how much each counts in the girth: half where two pieces meet, and by its level share.
        is_hem: whether the row is an edge of the garment.
    """

    ends: Mapping[str, IntArray]
    column: Mapping[str, IntArray]
    shares: Mapping[str, FloatArray]
    is_hem: bool

    def lengths(self, positions: Mapping[str, FloatArray], columns: int) -> FloatArray:
        """Return what each edge of the row has in the pattern, `columns` of them [m].

        Args:
            positions: by piece, #V by 2 [m].
            columns: edges of the row.
        """
        found = np.zeros(columns)
        for name, lengths in self.lengths_of_pieces(positions).items():
            np.add.at(found, self.column[name], lengths * self.shares[name])
        return found

    def lengths_of_pieces(self, positions: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return by piece, #E, how long its edges are where its vertices lie so (#V by 2 [m])."""
        return {
            name: np.linalg.norm(positions[name][ends[:, 0]] - positions[name][ends[:, 1]], axis=1)
            for name, ends in self.ends.items()
        }


class PieceEdges:
    """The edges of a form's pieces, found by those of the grid."""

    def __init__(self, layout: Layout, form: FormResult) -> None:
        self._form, self._mirror, self._count = form, layout.mirror, layout.vertex_count
        self._names = list(form.pieces)
        sides = [half_edges_of(piece.surface) for piece in form.pieces.values()]
        ends = [each.edges for each in sides]
        keys = [self._keys(piece.grid_vertices[edges]) for piece, edges in zip(form.pieces.values(), ends, strict=True)]
        order = np.argsort(np.concatenate(keys), kind="stable")
        self._sorted = np.concatenate(keys)[order]
        self._ends = np.concatenate(ends)[order]
        self._border = np.concatenate([each.count for each in sides])[order] == 1
        self._piece = np.repeat(np.arange(len(ends)), [len(edges) for edges in ends])[order]

    def along(self, row: IntArray, axis: FloatArray = UP) -> RowEdges | None:
        """Return the edges of pieces along a closed row; None where the pieces do not go all around.

        The right half of a half piece is its left one. Where the row slopes on the form, as at the bust under a lowered
        armhole, each of its edges counts by the share of it that is level, as tapes are level.

        Args:
            row: vertices of the grid, the first not repeated.
            axis: unit vector that tapes are level to, or :data:`ALONG`.
        """
        edges = np.column_stack([row, np.roll(row, -1)])
        side = self._form.vertices[edges[:, 1]] - self._form.vertices[edges[:, 0]]
        level_share = np.linalg.norm(side - np.outer(side @ axis, axis), axis=1) / np.linalg.norm(side, axis=1)
        keys_here, image = self._keys(edges), self._keys(self._mirror[edges])
        keys = np.where(self._copies(keys_here) > 0, keys_here, image)
        copies = self._copies(keys)
        if not copies.all():
            return None
        first = np.searchsorted(self._sorted, keys)
        is_hem = bool((copies == 1).all() and self._border[first].all())
        column = np.repeat(np.arange(len(keys)), copies)
        at = np.repeat(first, copies) + np.arange(len(column)) - np.repeat(np.cumsum(copies) - copies, copies)
        share = (level_share / copies)[column]
        of = {name: np.flatnonzero(self._piece[at] == number) for number, name in enumerate(self._names)}
        of = {name: chosen for name, chosen in of.items() if len(chosen)}
        return RowEdges(
            ends={name: self._ends[at[chosen]] for name, chosen in of.items()},
            column={name: column[chosen].astype(np.int32) for name, chosen in of.items()},
            shares={name: share[chosen] for name, chosen in of.items()},
            is_hem=is_hem,
        )

    def cut_along(self, row: IntArray, axis: FloatArray = UP) -> RowEdges | None:
        """Return the edges of pieces along a closed row, as :meth:`along`, but those of a hem whole: it is as long as it is cut."""
        edges = self.along(row, axis)
        return self.along(row, ALONG) if edges is not None and edges.is_hem else edges

    def _copies(self, keys: IntArray) -> IntArray:
        """Return how many edges of pieces lie on each edge of the grid."""
        return np.asarray(np.searchsorted(self._sorted, keys, "right") - np.searchsorted(self._sorted, keys, "left"))

    def _keys(self, edges: IntArray) -> IntArray:
        """Return one number for each edge of the grid (#E by 2), whichever way it runs."""
        low, high = np.sort(edges.astype(np.int64), axis=1).T
        return np.asarray(low * self._count + high)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tape:
    """A tape around a row of a body: it lies on what stands out and spans what is hollow.

    Attributes:
        edges: #R, its length along each edge of the row [m].
        curvature: #R, at each vertex [1/m]; 0 where it spans a hollow.
    """

    edges: FloatArray
    curvature: FloatArray

    @property
    def girth(self) -> float:
        """What it reads [m]."""
        return float(self.edges.sum())


def stretch_tape(points: FloatArray, axis: FloatArray = UP) -> Tape:
    """Return a tape around a closed row of a body, the outline of its convex hull seen along an axis.

    Args:
        points: #R by 3 [m], the first not repeated.
        axis: unit vector.
    """
    from scipy.spatial import ConvexHull

    flat = points @ plane_axes(axis).T
    # In a hull's own order around, the vertices of a simple row come as they come in the row.
    held = np.sort(ConvexHull(flat).vertices)
    along = np.concatenate([[0.0], np.cumsum(segment_lengths(flat, closed=True))])
    corners = flat[held]
    chords = np.roll(corners, -1, axis=0) - corners
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(chords, axis=1))])
    girth = reached[-1]
    knots = np.concatenate([along[held], [along[held[0]] + along[-1]]])
    # Between two places where it lies on the row, the tape's length follows that of the row.
    places = np.interp(np.where(along[:-1] < knots[0], along[:-1] + along[-1], along[:-1]), knots, reached)
    edges = np.mod(np.roll(places, -1) - places, girth)
    heading = np.unwrap(np.arctan2(chords[:, 1], chords[:, 0]))
    turn = np.sign(heading[-1] - heading[0]) * 2.0 * np.pi
    # It turns near its corners, within the length that cloth bridges, and is straight over a hollow.
    reach = np.minimum(0.5 * np.diff(reached), SKIN_LENGTH)
    where = np.column_stack([reached[:-1] + reach, reached[1:] - reach]).ravel()
    # Once more around at both ends.
    where = np.concatenate([where + turns * girth for turns in (-1, 0, 1)])
    angle = np.concatenate([np.repeat(heading, 2) + turns * turn for turns in (-1, 0, 1)])
    # A mean over that length too, or over a vertex's share of a coarse row.
    low, high = (np.maximum(0.5 * side, SKIN_LENGTH) for side in (np.roll(edges, 1), edges))
    change = np.interp(places + high, where, angle) - np.interp(places - low, where, angle)
    return Tape(edges=edges, curvature=np.maximum(np.sign(turn) * change / (low + high), 0.0))
