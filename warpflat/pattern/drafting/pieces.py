"""A pattern: pieces, seams, and a garment in its sizes; validated when they are made."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from warpflat.core import FloatArray, InputError, check_label, nearest, off_line, short_repr, without_side
from warpflat.flat import OVERLAP, overlap_width, overlapping
from warpflat.pattern.drafting.measures import UNITS
from warpflat.pattern.drafting.names import size_words
from warpflat.pattern.drafting.piece_parts import FOLD_STRAIGHT, SAME_POINT, Dart, Edge, FoundSeam, Hole, check_points
from warpflat.pattern.drafting.seam_difference import eased_length
from warpflat.pattern.drafting.words import translate_name
from warpflat.pattern.drafting.worn import Worn

__all__ = [
    "Elastic",
    "OpeningKind",
    "Pattern",
    "Piece",
    "Place",
    "Role",
    "Seam",
    "SeamSide",
    "check_hole",
    "unknown_size",
]


#: Kinds of :class:`SeamOpening`.
OpeningKind = Literal["zip", "buttons", "slit", "vent"]
#: Names of a piece and of an edge of it.
Place = tuple[str, str]
#: What a piece is, or is derived as.
Role = Literal[
    "shell", "facing", "strip", "waistband", "cuff", "collar", "hood", "lining", "interfacing", "pocket", "placket", "tie", "fly"
]  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """One piece of cloth in one size, flat, in metres.

    Attributes:
        name, size, fabric: for the label, the files' block names and the grouping of the marker.
        quantity: how often it is cut; an even number of a piece that is not its own mirror image is cut in pairs.
        edges: in order, closed and counter-clockwise; an edge of kind "fold" makes it a half on the fold of the cloth.
        darts: their legs are edges of the outline.
        internal_lines: #P by 2 [m] by name: feature lines, placement lines; drawn, not cut. Those whose name ends with `LEFT_OUT` are the
            borders of holes that could not be cut; they are dashed.
        grain: 2 by 2 [m], from and to, upwards along the warp; None takes the y axis through the middle.
        holes: cutouts and fish-eye darts.
        marks: points [m] by name that are marked through the cloth: buttons, corners of pockets.
        role: "shell", or what it is derived as: one of `Role`.
        also: cloths from which it is cut too, and how often, as interfacing.
        paired: False where all copies are cut the same way up, not left and right.
        title: what is printed instead of the name, in any language; the name with spaces if not given.
        units: of lengths in printed words, one of :data:`warpflat.pattern.drafting.measures.UNITS`.
        at: where it is worn, "front", "back", "left arm" or "right arm"; "" leaves that to its name and its seams.
        placement: 3 by 3 [m], where it hangs beside the body: (x, y, 1) on the piece maps to a place; None if unknown.
        levels: by edge the level of the body where it lies, such as the waist.
    """

    __repr__ = short_repr

    name: str
    size: str = ""
    fabric: str = ""
    quantity: int = 1
    edges: Sequence[Edge]
    darts: Sequence[Dart] = ()
    internal_lines: Mapping[str, FloatArray] = field(default_factory=dict)
    grain: FloatArray | None = None
    holes: Sequence[Hole] = ()
    marks: Mapping[str, FloatArray] = field(default_factory=dict)
    role: str = "shell"
    also: Mapping[str, int] = field(default_factory=dict)
    paired: bool = True
    title: str = ""
    units: str = "cm"
    at: str = ""
    placement: FloatArray | None = None
    levels: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"piece {self.name!r}" + (f" {size_words(self.size)}" if self.size else "")
        check_label(self.name, "a piece, to which files and seams refer")
        if self.title:
            check_label(self.title, "a piece's printed name")
        if self.units not in UNITS:
            raise InputError(f"{where}: unknown units {self.units!r}; {nearest(self.units, UNITS)}")
        if self.role not in get_args(Role):
            raise InputError(f"{where}: unknown role {self.role!r}; {nearest(self.role, get_args(Role))}")
        if (least := min([self.quantity, *self.also.values()])) < 1:
            raise InputError(f"{where}: quantity is {least}; it must be at least 1")
        object.__setattr__(self, "edges", tuple(self.edges))
        object.__setattr__(self, "darts", tuple(self.darts))
        object.__setattr__(self, "holes", tuple(self.holes))
        lines = {k: check_points(v, f"{where}, line {k!r}", at_least=2) for k, v in self.internal_lines.items()}
        object.__setattr__(self, "internal_lines", lines)
        marks = {k: check_points([at], f"{where}, mark {k!r}", at_least=1)[0] for k, at in self.marks.items()}
        object.__setattr__(self, "marks", marks)
        if self.grain is not None:
            grain = check_points(self.grain, f"{where}, grain", at_least=2)
            if len(grain) != 2 or np.linalg.norm(grain[1] - grain[0]) < SAME_POINT:
                raise InputError(f"{where}: the grain needs two different points, from and to")
            object.__setattr__(self, "grain", grain)
        check_piece(where, edges=self.edges, darts=self.darts, holes=self.holes, lines=lines)

    @property
    def is_pair(self) -> bool:
        """Whether it stands for the left and the right one; a patch pocket is alike on both sides."""
        return self.quantity % 2 == 0 and (self.role == "pocket" or (self.paired and not self.on_fold))

    @property
    def worn_at(self) -> str:
        """Where it is worn: `at`, else "front" or "back" as its name has it; "" where neither says so."""
        return self.at or next((side for side in ("front", "back") if side in self.name.lower()), "")

    @property
    def cloths(self) -> dict[str, int]:
        """The cloths from which it is cut, and how often in all."""
        return {self.fabric: 0, **self.also} | {self.fabric: self.quantity + self.also.get(self.fabric, 0)}

    def turned_over(self, quantity: int) -> list[bool]:
        """Return of each copy whether it is cut turned over: every second one of pairs."""
        pairs = self.paired and not self.on_fold and quantity % 2 == 0
        return [pairs and k % 2 == 1 for k in range(quantity)]

    @property
    def pleats(self) -> int:
        """The number of knife pleats laid in it, each at a line on which it is folded."""
        return sum(name.startswith("pleat fold") for name in self.internal_lines)

    @property
    def printed_name(self) -> str:
        """What stands on paper; of a pair without its side."""
        name = self.name.replace("_", " ") if self.name.strip("_ ") else self.name
        return self.title or translate_name(without_side(name) if self.is_pair else name)

    @property
    def on_fold(self) -> bool:
        """True for the half of a symmetric piece."""
        return any(edge.kind == "fold" for edge in self.edges)

    @property
    def outline(self) -> FloatArray:
        """Outline along all edges, dart legs included (#P by 2 [m]), closed, first point not repeated."""
        return np.concatenate([edge.points[:-1] for edge in self.edges])

    @property
    def dart_seams(self) -> tuple[Seam, ...]:
        """The darts as seams "PIECE.DART" that close them, both legs from the border to the tip."""
        return tuple(
            Seam(
                name=f"{self.name}.{dart.name}",
                sides=(
                    (SeamSide(piece=self.name, edge=dart.left),),
                    (SeamSide(piece=self.name, edge=dart.right, reversed=True),),
                ),
                double=False,
            )
            for dart in self.darts
        )

    def edge(self, name: str) -> Edge:
        """Return the edge of that name.

        Raises:
            InputError: there is none; gives the nearest name.
        """
        for edge in self.edges:
            if edge.name == name:
                return edge
        raise InputError(f"piece {self.name!r} has no edge {name!r}; {nearest(name, [e.name for e in self.edges])}")


@dataclass(frozen=True, kw_only=True)
class SeamSide:
    """A stretch of a seam's side: an edge of a piece, walked in the seam's direction.

    Attributes:
        piece, edge: names.
        reversed: the seam runs against the edge's own (counter-clockwise) direction.
        mirrored: the edge belongs to a copy of the piece that is cut turned over; all copies have the same notches.
        copy: the number of the copy, from 0: of pieces that are cut more than once, or in more than one pair.
    """

    piece: str
    edge: str
    reversed: bool = False
    mirrored: bool = False
    copy: int = 0

    @property
    def place(self) -> Place:
        """Names of the piece and the edge."""
        return self.piece, self.edge

    @property
    def cloth(self) -> tuple[str, bool, int]:
        """Which piece of cloth it is of: name of the piece, whether it is cut turned over, and number of the copy."""
        return self.piece, self.mirrored, self.copy

    @property
    def is_drawn(self) -> bool:
        """Whether it is the piece itself, not another copy."""
        return not self.mirrored and self.copy == 0

    def __str__(self) -> str:
        which = [f"copy {self.copy + 1}"] * (self.copy > 0) + ["mirrored"] * self.mirrored
        return f"{self.piece}.{self.edge}" + (f" ({', '.join(which)})" if which else "")


@dataclass(frozen=True, kw_only=True)
class SeamOpening:
    """Where a seam can be opened, or is not closed.

    Attributes:
        kind: "zip" or "buttons", from the upper end of the seam; "slit" or "vent", from its lower end.
        length: of the whole opening [m]; it may run on into another seam.
        begin: how far from that end of the seam it begins [m]; negative where it begins beyond that end, in another seam or in a band.
        whole: whether it reaches from there to the seam's other end.
        style: of a zip, "invisible" or "lapped".
    """

    kind: str
    length: float
    begin: float = 0.0
    whole: bool = False
    style: str = ""

    def __post_init__(self) -> None:
        if self.kind not in get_args(OpeningKind):
            raise InputError(f"unknown kind of opening {self.kind!r}; {nearest(self.kind, get_args(OpeningKind))}")


@dataclass(frozen=True, kw_only=True)
class Seam:
    """Two sides that are sewn together, each a chain of one or more edges in the same direction.

    Attributes:
        name: unique in the garment.
        sides: exactly two, each a sequence of `SeamSide`.
        ease: length of the second side over the first, minus 1: 0.03 eases 3 % more of the second side in.
        eased: shares of the first side's length between which the second is longer; all along it if not given.
        as_laid: whether its sides are as long as each other as a whole only: what one has more here than the other, in the points of its
            edges, is eased in there.
        notches: fractions of the first side's length in (0, 1) that get notches on both sides; None places them by length.
        size_notches: by size, fractions instead of `notches`, where a notch stands for a length, as the end of a zip.
        double: double notches; None means double where a back takes part and no front does.
        openings: where it can be opened, or is not closed.
    """

    name: str
    sides: tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]]
    ease: float = 0.0
    eased: tuple[float, float] = (0.0, 1.0)
    as_laid: bool = False
    notches: tuple[float, ...] | None = None
    size_notches: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    double: bool | None = None
    openings: tuple[SeamOpening, ...] = ()

    def __post_init__(self) -> None:
        if len(self.sides) != 2 or not all(self.sides):
            raise InputError(
                f"seam {self.name!r} has {len(self.sides)} sides; it must have two, each at least one edge"
            )
        if not -0.5 < self.ease < 5:
            raise InputError(f"seam {self.name!r}: ease {self.ease!r}; it must lie between -0.5 and 5 (0.03 is 3 %)")
        if not 0.0 <= self.eased[0] < self.eased[1] <= 1.0:
            raise InputError(
                f"seam {self.name!r}: eased between {self.eased}; two shares from 0 to 1, rising, are needed"
            )
        if any(not 0 < f < 1 for row in (self.notches or (), *self.size_notches.values()) for f in row):
            raise InputError(f"seam {self.name!r}: notches {self.notches}; each must be a fraction between 0 and 1")

    @property
    def stretches(self) -> tuple[SeamSide, ...]:
        """The stretches of both sides, those of the first side first."""
        return (*self.sides[0], *self.sides[1])

    def of_size(self, size: str) -> Seam:
        """Return the seam with the notches of one size."""
        return replace(self, notches=self.size_notches[size]) if size in self.size_notches else self

    def reach(self, length: float, whole: float) -> float:
        """Return the length along the second side opposite to `length` along the first, of `whole`."""
        return float(eased_length(length, whole, self.ease, self.eased))


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """An elastic that is threaded through a casing or a folded band.

    Attributes:
        edge: name of the edges, without their side.
        width: of the casing [m].
        lengths: of the elastic by size [m].
        count: how many the garment has.
    """

    edge: str
    width: float
    lengths: Mapping[str, float]
    count: int = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """All pieces of a garment in one or more sizes, and the seams between them (the same in every size).

    Attributes:
        name: for labels and files.
        pieces: by size, in the order in which sizes are listed; what a seam joins is in every size.
        seams: by name of piece and edge.
        sample_size: the size that files of one size show; None takes the middle one of those with the most pieces.
        words: what is printed instead of English words and names (see `warpflat.pattern.drafting.words`).
        elastics: that are threaded through its casings.
        worn: how it looks and what it measures on its body; None where that is not known.
        found_seams: with their prices, of a garment whose seams were found.
        notes: what the file from which it was read has beside it, one sentence each.
    """

    __repr__ = short_repr

    name: str
    pieces: Mapping[str, Sequence[Piece]]
    seams: Sequence[Seam] = ()
    sample_size: str | None = None
    words: Mapping[str, str] = field(default_factory=dict)
    elastics: Sequence[Elastic] = ()
    worn: Worn | None = None
    found_seams: Sequence[FoundSeam] = ()
    notes: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not self.pieces or not all(self.pieces.values()):
            raise InputError(f"garment {self.name!r} has no pieces; every size needs at least one")
        for size, pieces in self.pieces.items():
            # Every size has each of its pieces once.
            names = [piece.name for piece in pieces]
            doubled = sorted({n for n in names if names.count(n) > 1})
            if doubled:
                raise InputError(
                    f"garment {self.name!r}{f', size {size}' if size else ''}: piece {doubled[0]!r} occurs twice; names are unique"
                )
            for piece in pieces:
                if piece.size != size:
                    raise InputError(f"piece {piece.name!r} says size {piece.size!r} but is listed under {size!r}")
            # Every seam's edges exist in every size, and none is on the fold.
            for seam in self.seams:
                for side in seam.stretches:
                    try:
                        piece = self.piece(side.piece, size)
                        edge = piece.edge(side.edge)
                    except InputError as error:
                        raise InputError(f"seam {seam.name!r}{f', size {size}' if size else ''}: {error}") from None
                    if not 0 <= side.copy < piece.quantity:
                        raise InputError(
                            f"seam {seam.name!r}: {side} is not cut; piece {piece.name!r} has a quantity of {piece.quantity}"
                        )
                    if edge.kind == "fold":
                        raise InputError(f"seam {seam.name!r}: edge {side} lies on the fold and cannot be sewn")
        if self.sample_size is not None:
            self.check_size(self.sample_size)
        seen = [seam.name for seam in self.seams]
        if len(set(seen)) < len(seen):
            raise InputError(f"garment {self.name!r}: a seam's name occurs twice; names are unique")

    @property
    def sizes(self) -> tuple[str, ...]:
        """Sizes in their order."""
        return tuple(self.pieces)

    def with_each(self, change: Callable[[Piece], Piece]) -> Pattern:
        """Return the pattern with a change made to each of its pieces, in all sizes."""
        return replace(self, pieces={size: tuple(map(change, row)) for size, row in self.pieces.items()})

    def without(self, names: Collection[str]) -> Pattern:
        """Return the pattern without pieces of these names, and without their seams.

        Raises:
            InputError: none would be left of a size.
        """
        if any(all(piece.name in names for piece in row) for row in self.pieces.values()):
            raise InputError("none of the pieces can be drawn")
        pieces = {size: [piece for piece in row if piece.name not in names] for size, row in self.pieces.items()}
        seams = [seam for seam in self.seams if not any(s.piece in names for s in seam.stretches)]
        return replace(self, pieces=pieces, seams=seams)

    def check_size(self, size: str) -> None:
        """Check that there is such a size.

        Raises:
            InputError: there is none; gives the nearest.
        """
        if size not in self.pieces:
            raise unknown_size(self.name, size, self.pieces)

    @property
    def piece_names(self) -> tuple[str, ...]:
        """Names of the pieces of all sizes, those of the sample size first."""
        rows = (self.pieces[self.sample], *self.pieces.values())
        return tuple(dict.fromkeys(piece.name for row in rows for piece in row))

    @property
    def units(self) -> str:
        """Units of lengths in printed words: those of its pieces."""
        return next(iter(self.pieces.values()))[0].units

    @property
    def sample(self) -> str:
        """Size that is shown where only one is."""
        if self.sample_size is not None:
            return self.sample_size
        # Of those with the most pieces the middle one.
        most = max(map(len, self.pieces.values()))
        full = [size for size, row in self.pieces.items() if len(row) == most]
        return full[len(full) // 2]

    def piece(self, name: str, size: str) -> Piece:
        """Return the piece of that name and size.

        Raises:
            InputError: there is none; gives the nearest name.
        """
        self.check_size(size)
        for piece in self.pieces[size]:
            if piece.name == name:
                return piece
        raise InputError(f"no piece {name!r} in {self.name!r}; {nearest(name, [p.name for p in self.pieces[size]])}")

    def __iter__(self) -> Iterator[Piece]:
        for pieces in self.pieces.values():
            yield from pieces


def unknown_size(garment: str, size: str, sizes: Iterable[str]) -> InputError:
    """Return the error for a size that does not exist."""
    if tuple(sizes) == ("",):
        return InputError(f"garment {garment!r} has no sizes: it is not graded; leave {size!r} out")
    return InputError(f"garment {garment!r} has no size {size!r}; {nearest(size, sizes)}")


# A place in Shapely's messages: "Self-intersection[0.036 0.674]".
_PLACE = re.compile(r"\[(\S+) (\S+)\]")


def check_piece(
    where: str, *, edges: Sequence[Edge], darts: Sequence[Dart], holes: Sequence[Hole], lines: Mapping[str, FloatArray]
) -> None:
    """Check a piece of a pattern.

    Args:
        where: what messages begin with.
        edges, darts, holes: of the piece.
        lines: inside it, by name.

    Raises:
        InputError: a name that is unfit or occurs twice, edges that do not follow each other around a simple outline, a fold that is
            not straight, a dart whose legs are none, or a hole that crosses itself.
    """
    import shapely

    # Names are printable and unique.
    for what, names in (
        ("edge", [e.name for e in edges]),
        ("dart", [d.name for d in darts]),
        ("hole", [h.name for h in holes]),
        ("line", list(lines)),
    ):
        for name in names:
            check_label(name, f"{where}: {what}")
        doubled = sorted({n for n in names if names.count(n) > 1})
        if doubled:
            raise InputError(f"{where}: {what} {doubled[0]!r} occurs twice; names are unique in a piece")
    # Edges follow each other around a simple outline, counter-clockwise.
    if not edges:
        raise InputError(f"{where} has no edges; its outline needs at least one")
    for edge, follows in zip(edges, [*edges[1:], edges[0]], strict=True):
        gap = float(np.linalg.norm(edge.points[-1] - follows.points[0]))
        if gap > SAME_POINT:
            raise InputError(
                f"{where}: edge {edge.name!r} ends {gap * 1000:.3f} mm from where {follows.name!r} starts; "
                "edges follow each other and share their corners"
            )
        if edge.kind == "fold":
            start, end = edge.points[0], edge.points[-1]
            span = float(np.linalg.norm(end - start))
            if span < SAME_POINT:
                raise InputError(f"{where}: fold edge {edge.name!r} is closed; a fold is straight")
            stray = float(off_line(edge.points, edge.points[[0, -1]]).max())
            if stray > FOLD_STRAIGHT:
                raise InputError(
                    f"{where}: fold edge {edge.name!r} strays {stray * 1000:.2f} mm from straight; a fold strays at most "
                    f"{FOLD_STRAIGHT * 1000:.1f} mm (constrain it to a line)"
                )
    outline = np.concatenate([edge.points[:-1] for edge in edges])
    if len(outline) < 3:
        raise InputError(f"{where}: the outline has {len(outline)} points; it needs at least 3")
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or polygon.area <= 0:
        if polygon.length <= 0 or polygon.convex_hull.area <= 1e-9 * polygon.length**2:
            raise InputError(f"{where}: the outline encloses no area")
        place = _PLACE.search(shapely.is_valid_reason(polygon))
        at = "" if place is None else f" at ({1e3 * float(place[1]):.1f}, {1e3 * float(place[2]):.1f}) mm in the plane"
        raise InputError(
            f"{where}: the outline crosses itself{at}: flat, the piece lies over itself there; cut it apart, so that no "
            "piece does"
        )
    if not polygon.exterior.is_ccw:
        raise InputError(f"{where}: the outline runs clockwise; list its edges counter-clockwise")
    # A dart's legs are edges of its kind that follow each other.
    by_name = {edge.name: edge for edge in edges}
    names = list(by_name)
    legs = []
    for dart in darts:
        for leg in (dart.left, dart.right):
            if leg not in by_name:
                raise InputError(f"{where} has no edge {leg!r}; {nearest(leg, names)}")
            if by_name[leg].kind != "dart":
                raise InputError(
                    f"{where}: dart {dart.name!r} uses edge {leg!r} of kind {by_name[leg].kind!r}, not 'dart'"
                )
        if names[(names.index(dart.left) + 1) % len(names)] != dart.right:
            raise InputError(
                f"{where}: dart {dart.name!r}: edge {dart.right!r} must follow {dart.left!r} (the left leg comes "
                "first, counter-clockwise, and ends in the tip)"
            )
        legs += [dart.left, dart.right]
    for edge in edges:
        if edge.kind == "dart" and legs.count(edge.name) != 1:
            raise InputError(
                f"{where}: edge {edge.name!r} is of kind 'dart' but belongs to {legs.count(edge.name)} darts, not 1"
            )
    for hole in holes:
        check_hole(where, hole)


def check_hole(where: str, hole: Hole) -> None:
    """Check that the cloth around a hole does not lie on itself.

    Args:
        where: what messages begin with.
        hole: of a piece.

    Raises:
        InputError: it does.
    """
    width = overlap_width(hole.points)
    if width <= OVERLAP:
        return
    if hole.kind == "dart":
        raise InputError(f"{where}: dart {hole.name!r} {overlapping(width)}")
    raise InputError(
        f"{where}: the cloth around hole {hole.name!r} lies on itself by {width * 1000:.1f} mm; a hole runs "
        "counter-clockwise and does not cross itself"
    )
