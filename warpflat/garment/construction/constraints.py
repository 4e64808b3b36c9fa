"""Constraints on a border, a line or a dart: straight, of a fixed length, symmetric, a mouth of a given width, drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest, segment_lengths
from warpflat.flat import grain_axes
from warpflat.garment.construction.constraint_equations import (
    ConstraintEquations,
    length_equations,
    level_equations,
    mirror_equations,
    one_group,
    seam_equations,
    shape_equations,
    smooth_equations,
    straight_equations,
)
from warpflat.garment.construction.mirror import mirror_partners
from warpflat.garment.mannequin.layout import ARM_LEVELS

if TYPE_CHECKING:
    from warpflat.flat import Flattening
    from warpflat.garment.construction.details import OpeningTable
    from warpflat.garment.mannequin.forms import FormResult

__all__ = [
    "Constraint",
    "DartMouth",
    "DrawnLine",
    "FixedLength",
    "KeptGirth",
    "Straight",
    "Symmetric",
    "equations_of_constraint",
    "find_piece",
    "straight_hems",
    "straight_stands",
]


@dataclass(frozen=True, kw_only=True)
class Straight:
    """An edge or feature line that is straight in the pattern.

    Attributes:
        piece, line: names.
        along: "free" lets it take its direction, "warp" lays it parallel to the grain, "weft" at right angles to that.
        reach: how far from its upper end it is straight [m]; all along if not given.
    """

    piece: str
    line: str
    along: Literal["free", "warp", "weft"] = "free"
    reach: float = math.inf
    kind: ClassVar[str] = "straight"

    @property
    def name(self) -> str:
        """Name for reports."""
        return f"{self.piece}.{self.line} straight" + ("" if self.along == "free" else f" along {self.along}")


@dataclass(frozen=True, kw_only=True)
class FixedLength:
    """An edge or feature line whose every mesh edge keeps its length.

    Attributes:
        piece, line: names.
        length: of the whole line [m], shared by its mesh edges in proportion; None keeps the lengths on the body. On a
            half piece a line that ends on the fold counts with its mirror image: the half gets half of the length.
    """

    piece: str
    line: str
    length: float | None = None
    kind: ClassVar[str] = "length"

    @property
    def name(self) -> str:
        """Name for reports."""
        return f"{self.piece}.{self.line} length" + ("" if self.length is None else f" {1e3 * self.length:g} mm")


@dataclass(frozen=True, kw_only=True)
class Symmetric:
    """A piece, cut whole, whose left is the mirror image of its right.

    The axis comes to lie straight and keeps its direction in the pattern: upright, where it is the datum.

    Attributes:
        piece: name.
        line: the axis, from border to border, with the same faces on both sides.
    """

    piece: str
    line: str
    kind: ClassVar[str] = "symmetric"

    @property
    def name(self) -> str:
        """Name for reports."""
        return f"{self.piece} symmetric about {self.line}"


@dataclass(frozen=True, kw_only=True)
class DartMouth:
    """A dart that opens by a given width, or as wide as another one of its piece.

    Attributes:
        piece, dart: names.
        width: between the ends of its legs on the border, or half-way between its two tips [m]; None with `like`.
        like: the other dart's name; None with `width`.
    """

    piece: str
    dart: str
    width: float | None = None
    like: str | None = None
    kind: ClassVar[str] = "mouth"

    @property
    def name(self) -> str:
        """Name for reports."""
        wanted = f"like {self.like}" if self.width is None else f"{1e3 * self.width:g} mm"
        return f"{self.piece}.{self.dart} mouth {wanted}"


@dataclass(frozen=True, kw_only=True, eq=False)
class KeptGirth:
    """A level with a given girth around all pieces together, which share it as is easiest for them.

    Attributes:
        level: its name.
        edges: by piece, #E by 2, vertices.
        shares: by piece, #E, how much of an edge's length counts in the girth.
        lengths: by piece, #E [m]: lengths with which the girth is as it should be.
    """

    level: str
    edges: Mapping[str, IntArray] = field(repr=False)
    shares: Mapping[str, FloatArray] = field(repr=False)
    lengths: Mapping[str, FloatArray] = field(repr=False)
    kind: ClassVar[str] = "girth"

    @property
    def name(self) -> str:
        """Name for reports."""
        return f"{self.level} girth"


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnLine:
    """An edge that has the shape of a drawn line, wherever that lies on the cloth.

    Attributes:
        piece, line: names.
        vertices: of the piece, along the edge.
        shape: #V by 2, where they lie on the drawn line [m].
    """

    piece: str
    line: str
    vertices: IntArray = field(repr=False)
    shape: FloatArray = field(repr=False)
    kind: ClassVar[str] = "curve"

    @property
    def name(self) -> str:
        """Name for reports."""
        return f"{self.piece}.{self.line} drawn"


PieceConstraint = Straight | FixedLength | Symmetric | DartMouth | DrawnLine
Constraint = PieceConstraint | KeptGirth


def equations_of_constraint(
    constraint: PieceConstraint, piece: Flattening, fold: IntArray | None = None
) -> tuple[ConstraintEquations, bool]:
    """Return a constraint's equations in the piece's own numbering, and whether they orient the piece on the cloth.

    Args:
        constraint, piece: what is constrained.
        fold: the piece's vertices on its upright fold, if it has one.

    Raises:
        InputError: the piece has no such line, or the line cannot be constrained in this way.
    """
    if isinstance(constraint, DartMouth):
        lines = piece.network.surface.lines
        mouths = []
        for dart in (constraint.dart, *([] if constraint.like is None else [constraint.like])):
            if f"{dart}.left" not in lines:
                known = [line.removesuffix(".left") for line in lines if line.endswith(".left")]
                raise InputError(f"piece {constraint.piece!r} has no dart {dart!r}; {nearest(dart, known)}")
            left, right = lines[f"{dart}.left"], lines[f"{dart}.right"]
            # A fish-eye dart's legs both run from its first tip to its second.
            ends = (0, -1) if left[0] != right[0] else (len(left) // 2, len(left) // 2)
            mouths.append(np.array([left[ends[0]], right[ends[1]]], dtype=np.int32))
        if constraint.width is not None:
            return length_equations(mouths[0], np.array([constraint.width])), False
        return seam_equations(mouths[0], mouths[1]), False
    if isinstance(constraint, DrawnLine):
        return shape_equations(constraint.vertices, constraint.shape), False
    surface = piece.network.surface
    lines = piece.network.surface.lines
    if constraint.line not in lines:
        raise InputError(
            f"piece {constraint.piece!r} has no line {constraint.line!r}; {nearest(constraint.line, lines)}"
        )
    line = np.asarray(lines[constraint.line], dtype=np.int32)
    if len(line) < 2:
        raise InputError(f"{constraint.name}: the line has {len(line)} vertex; it needs two or more")
    if isinstance(constraint, FixedLength):
        lengths = segment_lengths(surface.vertices[line])
        if constraint.length is not None:
            on_fold = np.isin(line, [] if fold is None else fold)
            there = lengths.sum() * (2.0 if bool((on_fold[0] or on_fold[-1]) and not on_fold.all()) else 1.0)
            lengths = lengths * (constraint.length / there)
        return one_group(length_equations(line, lengths), smooth_equations(line, piece.positions, fold)), False
    if line[0] == line[-1]:
        raise InputError(f"{constraint.name}: the line is closed; it must run from one end to another")
    if isinstance(constraint, Straight):
        if math.isfinite(constraint.reach):
            down = surface.vertices[line[0], 1] >= surface.vertices[line[-1], 1]
            line = line if down else line[::-1]
            line = line[: 1 + np.searchsorted(arc_lengths(surface.vertices[line]), constraint.reach)]
        if constraint.along == "free":
            return straight_equations(line), False
        across = dict(zip(("weft", "warp"), grain_axes(piece.grain_angle), strict=True))
        if constraint.along not in across:
            raise InputError(f"{constraint.name}: {nearest(str(constraint.along), ('free', *across))}")
        return one_group(straight_equations(line), level_equations(line, across[constraint.along])), True
    try:
        partner = mirror_partners(surface.faces, line, vertex_count=len(surface.vertices))
    except InputError as error:
        raise InputError(f"{constraint.name}: {error}") from None
    vertices = np.arange(len(partner), dtype=np.int32)
    is_first = partner > vertices
    chord = piece.positions[line[-1]] - piece.positions[line[0]]
    across = np.array([chord[1], -chord[0]]) / np.linalg.norm(chord)
    axis = vertices[partner == vertices]
    pairs = np.column_stack([vertices, partner])[is_first]
    return mirror_equations(pairs, axis, across, float((piece.positions[axis] @ across).mean())), True


def find_piece(constraint: PieceConstraint, pieces: Mapping[str, Flattening]) -> Flattening:
    """Return the piece that a constraint is about.

    Raises:
        InputError: there is none of that name.
    """
    if constraint.piece not in pieces:
        raise InputError(f"{constraint.name}: no piece {constraint.piece!r}; {nearest(constraint.piece, pieces)}")
    return pieces[constraint.piece]


def straight_hems(form: FormResult, asked: Sequence[Constraint]) -> list[Straight]:
    """Return the hems of sleeves as straight lines; the cap, or fullness at the elbow, takes up what they would curve by.

    An upper arm tapers, and an elbow that is bent makes the cloth below it as long as it is bent, by column. A hem lies along the weft,
    or square to the forearm where an elbow dart swings it.

    Args:
        form: the garment.
        asked: constraints of its lines; what is asked for of a hem holds instead.
    """
    on_lines = [each for each in asked if isinstance(each, Straight | FixedLength | Symmetric | DrawnLine)]
    settled = {*form.seam_of_edges(), *((each.piece, each.line) for each in on_lines)}
    return [
        Straight(piece=name, line=edge, along="free" if piece.darts else "weft")
        for name, piece in form.pieces.items()
        for edge in piece.edges
        if edge.split(" ")[0] in ARM_LEVELS[1:] and (name, edge) not in settled and edge not in piece.leg_edges
    ]


def straight_stands(form: FormResult, openings: Sequence[OpeningTable]) -> list[Straight]:
    """Return the constraints that lay the edges of button stands and wraps straight along the grain; a fold is so anyway.

    Below a stand that ends within its seam, that may bend, as between the legs of trousers.
    """
    return [
        Straight(piece=name, line=opening.seam, along="warp", reach=opening.length if alone else math.inf)
        for opening in openings
        if opening.kind in ("buttons", "wrap")
        for alone in [sum(seam.edges[0] == opening.seam for seam in form.seams) == 1]
        for name, piece in form.pieces.items()
        if opening.seam in piece.edges and piece.fold != opening.seam
    ]
