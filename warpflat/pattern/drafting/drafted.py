"""Drafted pieces: cutting lines, sewing lines, notches, darts and labels in the plane."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, IntArray, arc_lengths, points_at_lengths, polyline_length, short_repr
from warpflat.pattern.drafting.curves import Curve
from warpflat.pattern.drafting.label import Label
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, unknown_size
from warpflat.pattern.drafting.seam_difference import LOCAL_TOLERANCE, SEAM_TOLERANCE
from warpflat.pattern.drafting.truing import CornerReport

__all__ = [
    "DraftedCutout",
    "DraftedDart",
    "DraftedEdge",
    "DraftedGarment",
    "DraftedPiece",
    "DrillHole",
    "Notch",
    "SeamReport",
    "drawn_leg",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedEdge:
    """An edge of the sewing line as a clean curve.

    Attributes:
        edge: as it came in.
        curve: fitted, from corner to corner.
        line: #P by 2 [m], its fine samples; neighbouring edges share their corners bit for bit.
        width: its allowance [m].
        places: the length [m] along the line of each point of the edge as it came in (each vertex of its mesh).
        fit_error: largest distance [m] of the curve from these points, before its corners were trued.
        tolerance: the distance [m] that was allowed, besides what equal length takes.
        mesh_vertices: the mesh vertex of each of these points; None of an edge that comes from no mesh.
    """

    edge: Edge
    curve: Curve
    line: FloatArray
    width: float
    places: FloatArray
    fit_error: float
    tolerance: float
    mesh_vertices: IntArray | None = None

    @property
    def name(self) -> str:
        return self.edge.name

    @property
    def kind(self) -> str:
        return self.edge.kind

    @property
    def length(self) -> float:
        """Length [m] along the sewing line."""
        return polyline_length(self.line)


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedDart:
    """The lines of a dart, whose legs are edges.

    Attributes:
        dart: as it came in.
        tip: [m].
        fold: #P by 2 [m], from the tip to the cut line; None where the dart is cut away.
        fold_to: side to which the wedge is pressed, "left" or "right"; "" where it is cut away.
        opening: of the mouth [m].
    """

    dart: Dart
    tip: FloatArray
    fold: FloatArray | None
    fold_to: str
    opening: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedCutout:
    """A hole that is cut out.

    Attributes:
        sew_line, cut_line: #P by 2 [m], closed; one line if the allowance is 0.
        width: allowance [m].
    """

    sew_line: FloatArray
    cut_line: FloatArray
    width: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DrillHole:
    """A point [m] marked through the cloth."""

    name: str
    at: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedPiece:
    """One piece in one size with all its lines, in metres: grain upwards, the fixed point of grading in the origin.

    Attributes:
        piece: as it came in.
        frame: 2 by 3, from the piece's coordinates to these (a rotation and a shift, never a scale).
        edges: the sewing line in order, dart legs included.
        cut_line: #P by 2 [m], closed, counter-clockwise, first point not repeated.
        darts, drill_holes, notches: see their classes.
        internal_lines, fisheyes: #P by 2 [m] by name; the latter closed.
        cutouts: by name.
        grain: 2 by 2 [m], from and to, upwards.
        label: its text and place.
        notes: what the cutter should know, one sentence each.
        enlarged: by what all lines are drawn larger across and along the grain, after `frame`, for cloth that shrinks.
    """

    __repr__ = short_repr

    piece: Piece
    frame: FloatArray
    edges: tuple[DraftedEdge, ...]
    cut_line: FloatArray
    darts: tuple[DraftedDart, ...]
    drill_holes: tuple[DrillHole, ...]
    notches: tuple[Notch, ...]
    internal_lines: Mapping[str, FloatArray]
    cutouts: Mapping[str, DraftedCutout]
    fisheyes: Mapping[str, FloatArray]
    grain: FloatArray
    label: Label
    notes: tuple[str, ...]
    enlarged: tuple[float, float] = (1.0, 1.0)

    @property
    def name(self) -> str:
        return self.piece.name

    @property
    def size(self) -> str:
        return self.piece.size

    @property
    def sew_line(self) -> FloatArray:
        """#P by 2 [m], the closed sewing line, dart legs included, first point not repeated."""
        return np.concatenate([edge.line[:-1] for edge in self.edges])

    @property
    def fold_edges(self) -> tuple[DraftedEdge, ...]:
        """The edges that lie on the fold of the cloth."""
        return tuple(edge for edge in self.edges if edge.kind == "fold")

    def edge(self, name: str) -> DraftedEdge:
        """Return the edge of that name.

        Raises:
            InputError: there is none; gives the nearest name.
        """
        self.piece.edge(name)
        return next(edge for edge in self.edges if edge.name == name)

    def drawn_line(self, edge: DraftedEdge) -> FloatArray:
        """Return what is drawn of an edge, #P by 2 [m]: all of it, but of the legs of a pleat what is sewn."""
        for dart in self.darts:
            if dart.dart.pleat is not None and edge.name == dart.dart.left:
                return drawn_leg(edge.line, dart.dart.pleat)
            if dart.dart.pleat is not None and edge.name == dart.dart.right:
                return drawn_leg(edge.line[::-1], dart.dart.pleat)[::-1]
        return edge.line


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedGarment:
    """A garment ready for the cutting table.

    Attributes:
        pattern: as it came in.
        pieces: by size.
        seams: how well the two sides of every seam agree.
        corners: where edges run on across seams, darts and folds, before and after truing.
    """

    __repr__ = short_repr

    pattern: Pattern
    pieces: Mapping[str, tuple[DraftedPiece, ...]]
    seams: tuple[SeamReport, ...]
    corners: tuple[CornerReport, ...] = ()

    @property
    def name(self) -> str:
        return self.pattern.name

    @property
    def sample(self) -> str:
        """Size that is shown where only one is; the first where the sample size is not drafted."""
        return self.pattern.sample if self.pattern.sample in self.pieces else next(iter(self.pieces))

    @property
    def piece_names(self) -> tuple[str, ...]:
        """Names of the pieces of all sizes, those of the first size first."""
        return tuple(dict.fromkeys(piece.name for piece in self))

    def all_sizes(self, name: str) -> tuple[DraftedPiece, ...]:
        """Return one piece in the sizes that have it, in the order of the sizes."""
        return tuple(piece for piece in self if piece.name == name)

    def of_sizes(self, sizes: Collection[str] | None) -> DraftedGarment:
        """Return the garment in some of its sizes, which keep their order; None keeps all.

        Raises:
            InputError: a size that is not drafted; gives the nearest.
        """
        for size in sizes or ():
            if size not in self.pieces:
                raise unknown_size(self.name, size, self.pieces)
        return (
            self
            if sizes is None
            else replace(self, pieces={size: self.pieces[size] for size in self.pieces if size in sizes})
        )

    def with_each(self, change: Callable[[DraftedPiece], DraftedPiece]) -> DraftedGarment:
        """Return the garment with a change made to each of its pieces, in all sizes."""
        return replace(self, pieces={size: tuple(map(change, row)) for size, row in self.pieces.items()})

    def __iter__(self) -> Iterator[DraftedPiece]:
        for pieces in self.pieces.values():
            yield from pieces


@dataclass(frozen=True, kw_only=True, eq=False)
class Notch:
    """A mark on the cut line that meets its counterpart when a seam is sewn.

    Attributes:
        seam: the seam, or the dart, that it belongs to.
        edge: the edge on which it stands.
        length: its place [m] along the seam from the seam's start, measured on this side.
        at: its point [m] on the sewing line.
        base: its start on the cut line [m]; a double notch has two.
        direction: unit vector into the piece.
        depth: [m].
    """

    seam: str
    edge: str
    length: float
    at: FloatArray
    base: tuple[FloatArray, ...]
    direction: FloatArray
    depth: float

    @property
    def double(self) -> bool:
        return len(self.base) == 2

    @property
    def slits(self) -> list[FloatArray]:
        """The slits that are cut, 2 by 2 [m] each, from the cut line inwards."""
        return [np.stack([base, base + self.depth * self.direction]) for base in self.base]


@dataclass(frozen=True, kw_only=True)
class SeamReport:
    """The lengths of the two sides of a seam in one size.

    Attributes:
        name, size: of the seam.
        sides: each side's edges, as "piece.edge + piece.edge".
        length_mm: of both sides [mm].
        ease: by how much the second side is meant to be longer, as a share.
        difference_mm: by how much the second side is too long (or, negative, too short) for that ease [mm].
        local_mm: the largest difference over 50 mm of the first side, without its sign, measured between the vertices
            of the mesh that both sides share; None where they come from no mesh, or from different vertices.
        notches_mm: the largest distance along the seam from a notch to the notch, or the joint, that it meets [mm]; None
            without notches.
    """

    name: str
    size: str
    sides: tuple[str, str]
    length_mm: tuple[float, float]
    ease: float
    difference_mm: float
    local_mm: float | None = None
    notches_mm: float | None = None

    @property
    def matches(self) -> bool:
        near = self.local_mm is None or self.local_mm <= LOCAL_TOLERANCE * 1000
        return near and abs(self.difference_mm) <= SEAM_TOLERANCE * 1000


def drawn_leg(line: FloatArray, depth: float) -> FloatArray:
    """Return the part of a pleat's line (#P by 2 [m], from the border) that is drawn: as far as it is sewn."""
    arc = arc_lengths(line)
    kept = arc < depth
    return line if kept.all() else np.vstack([line[kept], points_at_lengths(line, depth)])
