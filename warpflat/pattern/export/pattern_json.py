"""`pattern.json`: a drafted pattern with everything, written and read back: edges, cut lines, notches, darts, stitches, the mesh.

The models say what is read, with types, bounds and lengths. Lengths are metres, angles radians. Keys that follow from others,
such as `matches`, are written for other programs and not read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator
from pydantic_core import to_json

from warpflat._version import __version__
from warpflat.core import (
    FloatArray,
    InputError,
    Table,
    atomic_path,
    check_label,
    check_table,
    control_in,
    guarded,
    quote_value,
    read_json,
)
from warpflat.pattern.drafting.curves import Curve
from warpflat.pattern.drafting.cut_list import cut_list
from warpflat.pattern.drafting.drafted import (
    DraftedCutout,
    DraftedDart,
    DraftedEdge,
    DraftedGarment,
    DraftedPiece,
    DrillHole,
    Notch,
    SeamReport,
)
from warpflat.pattern.drafting.label import Label
from warpflat.pattern.drafting.piece_parts import Dart, Edge, FoundSeam, Hole
from warpflat.pattern.drafting.pieces import Elastic, Pattern, Piece, Seam, SeamOpening, SeamSide
from warpflat.pattern.drafting.worn import ClothKind, Measure, NeededOpening, ViewedPiece, Worn

__all__ = [
    "SCHEMA",
    "DartEntry",
    "PatternEntry",
    "PieceEntry",
    "SideEntry",
    "pattern_from_json",
    "pattern_json",
    "read_pattern_data",
    "read_pattern_json",
    "write_pattern_json",
]


#: No closed line of a pattern encloses less [m2].
SMALLEST_AREA = 1e-10


def _text(text: str) -> str:
    if letter := control_in(text, "\n"):
        raise ValueError(f"{quote_value(text)} has the control character {letter!r} in it")
    return text


def _ascending(shares: list[float]) -> list[float]:
    if shares[0] >= shares[1]:
        raise ValueError("the first share must be less than the second")
    return shares


def _ring(points: list[list[float]]) -> list[list[float]]:
    x, y = np.transpose(points)
    if abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 < SMALLEST_AREA:
        raise ValueError("encloses no area")
    return points


# A larger coordinate is an error of units, and its powers may overflow.
Coordinate = Annotated[float, Field(ge=-10_000, le=10_000)]
Length = Annotated[float, Field(ge=0, le=10_000)]
Name = Annotated[str, AfterValidator(lambda name: check_label(name, "name"))]
Text = Annotated[str, AfterValidator(_text)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Shares = Annotated[
    list[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=2, max_length=2), AfterValidator(_ascending)
]
Ends = Annotated[list[Point], Field(min_length=2, max_length=2)]
Line = Annotated[list[Point], Field(min_length=2)]
Ring = Annotated[list[Point], Field(min_length=3), AfterValidator(_ring)]
Segment = Annotated[list[Point], Field(min_length=4, max_length=4)]
Row = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]


class Entry(Table):
    """A part of the file; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore")


class EdgeEntry(Entry):
    """An edge of the sewing line (see `warpflat.pattern.drafting.drafted.DraftedEdge`)."""

    name: Name
    kind: Literal["seam", "hem", "fold", "cut", "dart"]
    allowance: Annotated[float, Field(ge=0, le=0.5)]
    bezier: Annotated[list[Segment], Field(min_length=1)]
    straight: list[bool]
    line: Line
    fit_error: Length
    tolerance: Length
    point_lengths: list[Length]
    mesh_vertices: list[Annotated[int, Field(ge=0, lt=2**31)]] | None

    @model_validator(mode="after")
    def _lengths_agree(self) -> EdgeEntry:
        if len(self.straight) != len(self.bezier):
            raise ValueError(
                f"straight has {len(self.straight)} entries, bezier {len(self.bezier)}; there is one for each curve"
            )
        if self.mesh_vertices is not None and len(self.mesh_vertices) != len(self.point_lengths):
            raise ValueError(
                f"mesh_vertices has {len(self.mesh_vertices)} entries, point_lengths {len(self.point_lengths)}; "
                "there is one for each point"
            )
        return self


class DartEntry(Entry):
    """A dart; its legs are edges."""

    name: Name
    left: Name
    right: Name
    tip: Point
    fold: Line | None
    fold_to: Literal["", "left", "right"]
    opening: float
    pleat: float | None = None


class NotchEntry(Entry):
    """A notch; a double one has two bases."""

    seam: Name
    edge: Name
    length: Length
    at: Point
    base: Annotated[list[Point], Field(min_length=1, max_length=2)]
    direction: Point
    depth: Length


class HoleEntry(Entry):
    """A drill hole."""

    name: Name
    at: Point


class LabelEntry(Entry):
    """The label of a piece: each text with the height of its capitals."""

    at: Point
    lines: Annotated[list[Text], Field(min_length=1)]
    heights: list[Annotated[float, Field(gt=0, le=10)]]
    angle: float = 0.0
    leader: Ends | None = None

    @model_validator(mode="after")
    def _lengths_agree(self) -> LabelEntry:
        if len(self.lines) != len(self.heights):
            raise ValueError(
                f"heights has {len(self.heights)} entries, lines {len(self.lines)}; there is one for each line"
            )
        return self


class PieceEntry(Entry):
    """A piece in one size (see `warpflat.pattern.drafting.drafted.DraftedPiece`).

    In files without `cutout_sew_lines` and `cutout_allowances` holes have no allowance: they are cut on the sewing
    line.
    """

    fabric: Text
    quantity: Annotated[int, Field(ge=1, le=1_000_000)]
    role: Literal[
        "shell",
        "facing",
        "strip",
        "waistband",
        "cuff",
        "collar",
        "hood",
        "lining",
        "interfacing",
        "pocket",
        "placket",
        "tie",
        "fly",
    ] = "shell"
    also: dict[Text, Annotated[int, Field(ge=1, le=1_000_000)]] = Field(default_factory=dict)
    enlarged: Annotated[list[Annotated[float, Field(gt=0, le=2)]], Field(min_length=2, max_length=2)] = Field(
        default=[1.0, 1.0]
    )
    marks: list[Name] = Field(default_factory=list)
    paired: bool
    title: Text = ""
    printed_units: Literal["mm", "cm", "in"] = "cm"
    at: Literal["", "front", "back", "left arm", "right arm"] = ""
    placement: Annotated[list[Row], Field(min_length=3, max_length=3)] | None = None
    levels: dict[Name, Text] = Field(default_factory=dict)
    frame: Annotated[list[Row], Field(min_length=2, max_length=2)]
    edges: Annotated[list[EdgeEntry], Field(min_length=1)]
    cut_line: Ring
    darts: list[DartEntry]
    notches: list[NotchEntry]
    drill_holes: list[HoleEntry]
    internal_lines: dict[Name, Line]
    cutouts: dict[Name, Ring]
    cutout_sew_lines: dict[Name, Ring] = Field(default_factory=dict)
    cutout_allowances: dict[Name, Annotated[float, Field(ge=0, le=0.5)]] = Field(default_factory=dict)
    fisheye_darts: dict[Name, Ring]
    grain: Ends
    label: LabelEntry
    notes: list[Text]


class SideEntry(Entry):
    """One edge of a seam's side."""

    piece: Name
    edge: Name
    reversed: bool
    mirrored: bool = False
    copy_number: Annotated[int, Field(alias="copy", ge=0, le=1_000_000)] = 0


class OpeningEntry(Entry):
    """An opening of a seam (see `warpflat.pattern.drafting.pieces.SeamOpening`)."""

    kind: Literal["zip", "buttons", "slit", "vent"]
    length: float
    begin: float
    whole: bool
    style: Text


class StitchEntry(Entry):
    """A seam, or a dart that is sewn shut."""

    name: Name
    kind: Literal["seam", "dart"]
    ease: float
    eased: Shares = Field(default=[0.0, 1.0])
    openings: list[OpeningEntry] = Field(default_factory=list)
    sides: Annotated[list[Annotated[list[SideEntry], Field(min_length=1)]], Field(min_length=2, max_length=2)]


class SeamEntry(Entry):
    """The lengths of the two sides of a seam in one size (see `warpflat.pattern.drafting.drafted.SeamReport`)."""

    name: Name
    size: Text
    sides: Annotated[list[Text], Field(min_length=2, max_length=2)]
    length_mm: Annotated[list[float], Field(min_length=2, max_length=2)]
    ease: float
    difference_mm: float
    difference_per_50mm_mm: float | None
    notches_mm: float | None = None


class ElasticEntry(Entry):
    """An elastic in a casing (see `warpflat.pattern.drafting.pieces.Elastic`)."""

    edge: Name
    width: Length
    lengths: dict[Text, Length]
    count: Annotated[int, Field(ge=1, le=1000)] = 1


class ViewEntry(Entry):
    """A piece in the line drawing (see `warpflat.pattern.drafting.worn.ViewedPiece`)."""

    outlines: list[Ring]
    lines: list[Line]


class MeasureEntry(Entry):
    """A girth of the body and of the finished garment [m]."""

    name: Name
    body: Length
    finished: Length
    asked: Length | None = None


class NeededEntry(Entry):
    """A way around the garment that needs an opening [m]."""

    ring: Name
    length: Length
    over: Text
    girth: Length
    depth: Length


class ClothEntry(Entry):
    """What a shop knows a cloth by (see `warpflat.pattern.drafting.worn.ClothKind`)."""

    kind: Literal["woven", "knit"]
    weight: Length
    stretch: Annotated[list[Length], Field(min_length=2, max_length=2)]
    examples: list[Text] = Field(default_factory=list)


class WornEntry(Entry):
    """The garment on its body."""

    views: dict[Literal["front", "back"], list[ViewEntry]] = Field(default_factory=dict)
    measures: dict[Text, list[MeasureEntry]] = Field(default_factory=dict)
    needed: list[NeededEntry] = Field(default_factory=list)
    knits: list[Text] = Field(default_factory=list)
    failing: list[Literal["held", "pressing", "too large", "misfit", "not at rest"]] = Field(default_factory=list)
    cloths: dict[Text, ClothEntry] = Field(default_factory=dict)
    buttonholes: Literal["left", "right"] = "right"


class FoundSeamEntry(Entry):
    """A seam that was found on a whole garment (see `warpflat.pattern.drafting.piece_parts.FoundSeam`)."""

    name: Name
    length_m: Length
    released_j: float | None
    needed: Text


class PatternEntry(Entry):
    """The whole file: pieces by size and name, stitches, the lengths of seams, and the garment as it is worn."""

    name: Name
    sample_size: Text
    words: dict[Text, Text] = Field(default_factory=dict)
    sizes: dict[Text, Annotated[dict[Name, PieceEntry], Field(min_length=1)]] = Field(min_length=1)
    stitches: list[StitchEntry]
    seams: list[SeamEntry]
    elastics: list[ElasticEntry] = Field(default_factory=list)
    worn: WornEntry | None = None
    found_seams: list[FoundSeamEntry] = Field(default_factory=list)


#: Increased when a reader of the old form would misread the new one.
SCHEMA = 1


def pattern_json(garment: DraftedGarment) -> dict[str, Any]:
    """Return the whole pattern as plain lists and numbers: lengths in metres, angles in radians, y along the grain.

    A stitch sews two sides. Each side lists its edges in the order in which the seam meets them, and whether the seam
    runs against the edge's own direction (counter-clockwise round its piece); "mirrored" is an edge of a copy that is
    cut turned over, and "copy" its number, from 1 for the second. An edge's `point_lengths` are the lengths along its line at the
    points of its mesh's border, and `fit_error` is the largest distance of the curve from them. Numbers are not rounded.
    """
    sample = next(iter(garment.pieces.values()))
    stitches: list[dict[str, Any]] = [
        {
            "name": seam.name,
            "kind": "seam",
            "ease": seam.ease,
            "eased": list(seam.eased),
            "sides": [[_side(part) for part in side] for side in seam.sides],
            "openings": [asdict(opening) for opening in seam.openings],
        }
        for seam in garment.garment.seams
    ]
    stitches += [
        {
            "name": f"{piece.name}.{dart.dart.name}",
            "kind": "dart",
            "ease": 0.0,
            "eased": [0.0, 1.0],
            "sides": [
                [_side(SeamSide(piece=piece.name, edge=dart.dart.left))],
                [_side(SeamSide(piece=piece.name, edge=dart.dart.right, reversed=True))],
            ],
        }
        for piece in sample
        for dart in piece.darts
    ]
    return {
        "schema": SCHEMA,
        "warpflat": __version__,
        "units": "m",
        "name": garment.name,
        "sample_size": garment.garment.sample,
        "words": dict(garment.garment.words),
        "sizes": {size: {piece.name: _piece(piece) for piece in pieces} for size, pieces in garment.pieces.items()},
        "cut_list": {
            size: {cloth: [asdict(entry) for entry in rows] for cloth, rows in cut_list(pieces).items()}
            for size, pieces in garment.pieces.items()
        },
        "stitches": stitches,
        "elastics": [asdict(elastic) for elastic in garment.garment.elastics],
        "worn": None if garment.garment.worn is None else _worn(garment.garment.worn),
        "found_seams": [seam.as_dict() for seam in garment.garment.found_seams],
        "seams": [
            {
                "name": report.name,
                "size": report.size,
                "sides": list(report.sides),
                "length_mm": list(report.length_mm),
                "ease": report.ease,
                "difference_mm": report.difference_mm,
                "difference_per_50mm_mm": report.local_mm,
                "notches_mm": report.notches_mm,
                "matches": report.matches,
            }
            for report in garment.seams
        ],
    }


def write_pattern_json(garment: DraftedGarment, path: str | os.PathLike[str]) -> None:
    """Write :func:`pattern_json`; the file appears whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_json(pattern_json(garment), indent=1) + b"\n")


def _side(side: SeamSide) -> dict[str, Any]:
    entry = {"piece": side.piece, "edge": side.edge, "reversed": side.reversed, "mirrored": side.mirrored}
    return {**entry, "copy": side.copy} if side.copy else entry


def _piece(piece: DraftedPiece) -> dict[str, Any]:
    return {
        "fabric": piece.piece.fabric,
        "quantity": piece.piece.quantity,
        "role": piece.piece.role,
        "also": dict(piece.piece.also),
        "enlarged": list(piece.enlarged),
        "marks": sorted(piece.piece.marks),
        "paired": piece.piece.paired,
        "title": piece.piece.title,
        "printed_units": piece.piece.units,
        "on_fold": piece.piece.on_fold,
        "at": piece.piece.at,
        "placement": None if piece.piece.placement is None else piece.piece.placement.tolist(),
        "frame": piece.frame.tolist(),
        "levels": dict(piece.piece.levels),
        "edges": [
            {
                "name": edge.name,
                "kind": edge.kind,
                "allowance": edge.width,
                "length": edge.length,
                "bezier": edge.curve.bezier.tolist(),
                "straight": edge.curve.straight.tolist(),
                "line": edge.line.tolist(),
                "fit_error": edge.fit_error,
                "tolerance": edge.tolerance,
                "point_lengths": edge.places.tolist(),
                "mesh_vertices": None if edge.edge.vertices is None else np.asarray(edge.edge.vertices).tolist(),
            }
            for edge in piece.edges
        ],
        "cut_line": piece.cut_line.tolist(),
        "darts": [
            {
                "name": dart.dart.name,
                "left": dart.dart.left,
                "right": dart.dart.right,
                "tip": dart.tip.tolist(),
                "fold": None if dart.fold is None else dart.fold.tolist(),
                "fold_to": dart.fold_to,
                "opening": dart.opening,
                "pleat": dart.dart.pleat,
                "length_mm": [1000 * piece.edge(leg).length for leg in (dart.dart.left, dart.dart.right)],
            }
            for dart in piece.darts
        ],
        "notches": [
            {
                "seam": notch.seam,
                "edge": notch.edge,
                "length": notch.length,
                "at": notch.at.tolist(),
                "base": [base.tolist() for base in notch.base],
                "direction": notch.direction.tolist(),
                "depth": notch.depth,
                "double": notch.double,
            }
            for notch in piece.notches
        ],
        "drill_holes": [{"name": hole.name, "at": hole.at.tolist()} for hole in piece.drill_holes],
        "internal_lines": _lists(piece.internal_lines),
        "cutouts": _lists({name: cutout.cut_line for name, cutout in piece.cutouts.items()}),
        "cutout_sew_lines": _lists({name: cutout.sew_line for name, cutout in piece.cutouts.items()}),
        "cutout_allowances": {name: cutout.width for name, cutout in piece.cutouts.items()},
        "fisheye_darts": _lists(piece.fisheyes),
        "grain": piece.grain.tolist(),
        "label": {
            "at": piece.label.at.tolist(),
            "lines": [text for text, _ in piece.label.lines],
            "heights": [height for _, height in piece.label.lines],
            "angle": piece.label.angle,
            "leader": None if piece.label.leader is None else piece.label.leader.tolist(),
        },
        "notes": list(piece.notes),
    }


def _lists(lines: Mapping[str, Sequence[Any] | np.ndarray[Any, Any]]) -> dict[str, Any]:
    return {name: np.asarray(line).tolist() for name, line in lines.items()}


def read_pattern_json(path: str | os.PathLike[str]) -> DraftedGarment:
    """Read the pattern of a file that :func:`warpflat.pattern.export.pattern_json.write_pattern_json` wrote.

    Raises:
        InputError: the file is missing, no JSON, of another schema, or does not hold together.
    """
    data = read_pattern_data(Path(path))
    with guarded(Path(path), "JSON"):
        return pattern_from_json(data)


def read_pattern_data(path: Path) -> Any:
    """Return what a pattern's file in JSON holds.

    Raises:
        InputError: the file is missing, or no JSON.
    """
    if path.parent.is_file():
        raise InputError(f"{path.parent}: is a file; give the folder of a run, where its pattern.json lies")
    return read_json(path, missing="no such file; a run leaves a pattern.json in its folder")


def pattern_from_json(data: Any) -> DraftedGarment:
    """Return the pattern of the data that :func:`warpflat.pattern.export.pattern_json.pattern_json` gave.

    Raises:
        InputError: another schema, a missing key, a value of the wrong kind, or lines that are no pattern.
    """
    if not isinstance(data, Mapping) or "sizes" not in data:
        raise InputError('is no pattern of warpflat, which has "sizes", or of GarmentCode, which has "pattern"')
    if data.get("schema") != SCHEMA:
        raise InputError(
            f"has schema {quote_value(data.get('schema'))}; this version reads {SCHEMA}: run the scene again"
        )
    try:
        data = check_table(PatternEntry, data)
        drafted = {
            size: tuple(_read_piece(name, size, piece) for name, piece in pieces.items())
            for size, pieces in data.sizes.items()
        }
        garment = Pattern(
            name=data.name,
            pieces={size: tuple(piece.piece for piece in pieces) for size, pieces in drafted.items()},
            seams=[
                Seam(
                    name=stitch.name,
                    sides=(_read_side(stitch.sides[0]), _read_side(stitch.sides[1])),
                    ease=stitch.ease,
                    eased=(stitch.eased[0], stitch.eased[1]),
                    openings=tuple(SeamOpening(**each.model_dump()) for each in stitch.openings),
                )
                for stitch in data.stitches
                if stitch.kind == "seam"
            ],
            sample_size=data.sample_size,
            words=data.words,
            elastics=tuple(Elastic(**each.model_dump()) for each in data.elastics),
            worn=None if data.worn is None else _read_worn(data.worn),
            found_seams=[
                FoundSeam(name=one.name, length=one.length_m, released=one.released_j, needed=one.needed)
                for one in data.found_seams
            ],
        )
        reports = tuple(
            SeamReport(
                name=seam.name,
                size=seam.size,
                sides=(seam.sides[0], seam.sides[1]),
                length_mm=(seam.length_mm[0], seam.length_mm[1]),
                ease=seam.ease,
                difference_mm=seam.difference_mm,
                local_mm=seam.difference_per_50mm_mm,
                notches_mm=seam.notches_mm,
            )
            for seam in data.seams
        )
        return DraftedGarment(garment=garment, pieces=drafted, seams=reports)
    except InputError as error:
        raise InputError(f"{error}; run the scene again") from None


def _worn(worn: Worn) -> dict[str, Any]:
    """Return the entry of a garment as it is worn."""
    return {
        "views": {
            side: [
                {"outlines": [x.tolist() for x in each.outlines], "lines": [x.tolist() for x in each.lines]}
                for each in row
            ]
            for side, row in worn.views.items()
        },
        "measures": {size: [asdict(each) for each in row] for size, row in worn.measures.items()},
        "needed": [asdict(each) for each in worn.needed],
        "knits": list(worn.knits),
        "failing": list(worn.failing),
        "cloths": {name: asdict(each) for name, each in worn.cloths.items()},
        "buttonholes": worn.buttonholes,
    }


def _read_worn(data: WornEntry) -> Worn:
    """Return a garment as it is worn."""
    return Worn(
        views={
            side: tuple(
                ViewedPiece(
                    outlines=tuple(np.array(x) for x in each.outlines), lines=tuple(np.array(x) for x in each.lines)
                )
                for each in row
            )
            for side, row in data.views.items()
        },
        measures={size: tuple(Measure(**each.model_dump()) for each in row) for size, row in data.measures.items()},
        needed=tuple(NeededOpening(**each.model_dump()) for each in data.needed),
        knits=tuple(data.knits),
        failing=tuple(data.failing),
        cloths={
            name: ClothKind(
                kind=each.kind,
                weight=each.weight,
                stretch=(each.stretch[0], each.stretch[1]),
                examples=tuple(each.examples),
            )
            for name, each in data.cloths.items()
        },
        buttonholes=data.buttonholes,
    )


def _read_side(parts: Sequence[SideEntry]) -> tuple[SeamSide, ...]:
    return tuple(
        SeamSide(piece=p.piece, edge=p.edge, reversed=p.reversed, mirrored=p.mirrored, copy=p.copy_number)
        for p in parts
    )


def _read_piece(name: str, size: str, data: PieceEntry) -> DraftedPiece:
    frame = np.array(data.frame)
    darts = [
        Dart(name=d.name, left=d.left, right=d.right, fold_to=d.fold_to or None, pleat=d.pleat) for d in data.darts
    ]
    cutouts = {
        key: DraftedCutout(
            sew_line=np.array(data.cutout_sew_lines.get(key, line)),
            cut_line=np.array(line),
            width=data.cutout_allowances.get(key, 0.0),
        )
        for key, line in data.cutouts.items()
    }
    fisheyes = {key: np.array(line) for key, line in data.fisheye_darts.items()}
    internal_lines = {key: np.array(line) for key, line in data.internal_lines.items()}
    grain = np.array(data.grain)
    holes = [
        Hole(name=key, points=_to_mesh(cutout.sew_line, frame), allowance=cutout.width)
        for key, cutout in cutouts.items()
    ]
    holes += [Hole(name=key, points=_to_mesh(line, frame), kind="dart") for key, line in fisheyes.items()]
    piece = Piece(
        name=name,
        size=size,
        fabric=data.fabric,
        quantity=data.quantity,
        role=data.role,
        also=data.also,
        marks={
            hole.name: _to_mesh(np.array([hole.at]), frame)[0] for hole in data.drill_holes if hole.name in data.marks
        },
        paired=data.paired,
        title=data.title,
        units=data.printed_units,
        at=data.at,
        placement=None if data.placement is None else np.array(data.placement),
        levels=data.levels,
        edges=[
            Edge(
                name=edge.name,
                points=_to_mesh(np.array(edge.line), frame),
                kind=edge.kind,
                allowance=None if edge.kind == "fold" else edge.allowance,
                vertices=None if edge.mesh_vertices is None else np.array(edge.mesh_vertices, dtype=np.int32),
            )
            for edge in data.edges
        ],
        darts=darts,
        internal_lines={key: _to_mesh(line, frame) for key, line in internal_lines.items()},
        grain=_to_mesh(grain, frame),
        holes=holes,
    )
    return DraftedPiece(
        piece=piece,
        frame=frame,
        edges=tuple(
            DraftedEdge(
                edge=edge,
                curve=Curve(bezier=np.array(d.bezier), straight=np.array(d.straight)),
                line=np.array(d.line),
                width=d.allowance,
                places=np.array(d.point_lengths),
                fit_error=d.fit_error,
                tolerance=d.tolerance,
            )
            for edge, d in zip(piece.edges, data.edges, strict=True)
        ),
        cut_line=np.array(data.cut_line),
        darts=tuple(
            DraftedDart(
                dart=dart,
                tip=np.array(d.tip),
                fold=None if d.fold is None else np.array(d.fold),
                fold_to=d.fold_to,
                opening=d.opening,
            )
            for dart, d in zip(darts, data.darts, strict=True)
        ),
        drill_holes=tuple(DrillHole(name=hole.name, at=np.array(hole.at)) for hole in data.drill_holes),
        notches=tuple(
            Notch(
                seam=notch.seam,
                edge=notch.edge,
                length=notch.length,
                at=np.array(notch.at),
                base=tuple(np.array(base) for base in notch.base),
                direction=np.array(notch.direction),
                depth=notch.depth,
            )
            for notch in data.notches
        ),
        internal_lines=internal_lines,
        cutouts=cutouts,
        fisheyes=fisheyes,
        grain=grain,
        label=Label(
            at=np.array(data.label.at),
            lines=tuple(zip(data.label.lines, data.label.heights, strict=True)),
            angle=data.label.angle,
            leader=None if data.label.leader is None else np.array(data.label.leader),
        ),
        notes=tuple(data.notes),
        enlarged=(data.enlarged[0], data.enlarged[1]),
    )


def _to_mesh(points: FloatArray, frame: FloatArray) -> FloatArray:
    """Map points from the drafted piece's coordinates to those of the flat mesh."""
    turn = frame[:, :2]
    return (points - frame[:, 2]) @ turn
