"""`pattern.json`: a drafted pattern with everything, written and read back: edges, cut lines, notches, darts, stitches, the mesh.

The models say what is read, with types, bounds and lengths. What a model and the object that it tells of call alike is written and
read by that name alone (`_told`, `_made`). Lengths are metres, angles radians. Keys that follow from others, such as `matches`, are
written for other programs and not read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator
from pydantic_core import to_json

from warpflat._version import __version__
from warpflat.core import (
    FloatArray,
    InputError,
    Table,
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
    SeamReport,
)
from warpflat.pattern.drafting.label import Label
from warpflat.pattern.drafting.measures import Units
from warpflat.pattern.drafting.piece_parts import MOST_ALLOWANCE, Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import OpeningKind, Pattern, Piece, Role, Seam, SeamSide
from warpflat.pattern.drafting.polygons import signed_area
from warpflat.pattern.files.output import atomic_path

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
    if abs(signed_area(np.array(points))) < SMALLEST_AREA:
        raise ValueError("encloses no area")
    return points


# A larger coordinate is an error of units, and its powers may overflow.
Coordinate = Annotated[float, Field(ge=-10_000, le=10_000)]
Length = Annotated[float, Field(ge=0, le=10_000)]
Allowance = Annotated[float, Field(ge=0, le=MOST_ALLOWANCE)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Name = Annotated[str, AfterValidator(lambda name: check_label(name, "name"))]
Text = Annotated[str, AfterValidator(_text)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Shares = Annotated[
    list[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=2, max_length=2), AfterValidator(_ascending)
]
Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Ends = Annotated[list[Point], Field(min_length=2, max_length=2)]
Line = Annotated[list[Point], Field(min_length=2)]
Ring = Annotated[list[Point], Field(min_length=3), AfterValidator(_ring)]
Segment = Annotated[list[Point], Field(min_length=4, max_length=4)]
Row = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]


class Entry(Table):
    """A part of the file; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore")

    def _check_as_many(self, key: str, other: str, what: str) -> None:
        """Check that two lists are equally long, with one entry for each of something."""
        one, two = len(getattr(self, key)), len(getattr(self, other))
        if one != two:
            raise ValueError(f"{key} has {one} entries, {other} {two}; there is one for each {what}")


class EdgeEntry(Entry):
    """An edge of the sewing line (see `warpflat.pattern.drafting.drafted.DraftedEdge`)."""

    name: Name
    kind: Literal["seam", "hem", "fold", "cut", "dart"]
    allowance: Allowance
    bezier: Annotated[list[Segment], Field(min_length=1)]
    straight: list[bool]
    line: Line
    fit_error: Length
    tolerance: Length
    point_lengths: list[Length]
    mesh_vertices: list[Annotated[int, Field(ge=0, lt=2**31)]] | None

    @model_validator(mode="after")
    def _lengths_agree(self) -> EdgeEntry:
        self._check_as_many("straight", "bezier", "curve")
        if self.mesh_vertices is not None:
            self._check_as_many("mesh_vertices", "point_lengths", "point")
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
    cut: bool = False
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
        self._check_as_many("heights", "lines", "line")
        return self


class PieceEntry(Entry):
    """A piece in one size (see `warpflat.pattern.drafting.drafted.DraftedPiece`).

    In files without `cutout_sew_lines` and `cutout_allowances` holes have no allowance: they are cut on the sewing
    line.
    """

    fabric: Text
    quantity: Count
    role: Role = "shell"
    also: dict[Text, Count] = Field(default_factory=dict)
    enlarged: Annotated[list[Annotated[float, Field(gt=0, le=2)]], Field(min_length=2, max_length=2)] = Field(
        default=[1.0, 1.0]
    )
    marks: list[Name] = Field(default_factory=list)
    paired: bool
    title: Text = ""
    printed_units: Units = "cm"
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
    cutout_allowances: dict[Name, Allowance] = Field(default_factory=dict)
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

    kind: OpeningKind
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
    as_laid: bool = False
    notches: list[Share] | None = None
    size_notches: dict[Text, list[Share]] = Field(default_factory=dict)
    double: bool | None = None
    openings: list[OpeningEntry] = Field(default_factory=list)
    sides: Annotated[list[Annotated[list[SideEntry], Field(min_length=1)]], Field(min_length=2, max_length=2)]


class ReportEntry(Entry):
    """The lengths of the two sides of a seam in one size (see `warpflat.pattern.drafting.drafted.SeamReport`)."""

    name: Name
    size: Text
    sides: Annotated[list[Text], Field(min_length=2, max_length=2)]
    length_mm: Annotated[list[float], Field(min_length=2, max_length=2)]
    ease: float
    difference_mm: float
    local_mm: float | None = Field(alias="difference_per_50mm_mm")
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


class PriceEntry(Entry):
    """A seam that was found on a whole garment (see `warpflat.pattern.drafting.piece_parts.FoundSeam`)."""

    name: Name
    length: Length = Field(alias="length_m")
    released: float | None = Field(alias="released_j")
    needed: Text


class PatternEntry(Entry):
    """The whole file: pieces by size and name, stitches, the lengths of seams, and the garment as it is worn."""

    name: Name
    sample_size: Text
    words: dict[Text, Text] = Field(default_factory=dict)
    sizes: dict[Text, Annotated[dict[Name, PieceEntry], Field(min_length=1)]] = Field(min_length=1)
    stitches: list[StitchEntry]
    seams: list[ReportEntry]
    elastics: list[ElasticEntry] = Field(default_factory=list)
    worn: WornEntry | None = None
    found_seams: list[PriceEntry] = Field(default_factory=list)
    notes: list[Text] = Field(default_factory=list)


#: Increased when a reader of the old form would misread the new one.
SCHEMA = 1


def pattern_json(garment: DraftedGarment) -> dict[str, Any]:
    """Return the whole pattern as plain lists and numbers: lengths in metres, angles in radians, y along the grain.

    A stitch sews two sides. Each side lists its edges in the order in which the seam meets them, and whether the seam
    runs against the edge's own direction (counter-clockwise round its piece); "mirrored" is an edge of a copy that is
    cut turned over, and "copy" its number, from 1 for the second. An edge's `point_lengths` are the lengths along its line at the
    points of its mesh's border, and `fit_error` is the largest distance of the curve from them. Numbers are not rounded.
    """
    pattern, sample = garment.pattern, next(iter(garment.pieces.values()))
    darts = [seam for piece in sample for seam in piece.piece.dart_seams]
    sizes = dict[str, dict[str, Any]]()
    for size, pieces in garment.pieces.items():
        entries = sizes.setdefault(size, {})
        for piece in pieces:
            own, label = piece.piece, piece.label
            edges = [
                _told(
                    EdgeEntry,
                    edge,
                    name=edge.name,
                    kind=edge.kind,
                    allowance=edge.width,
                    length=edge.length,
                    point_lengths=edge.places.tolist(),
                    **_told(EdgeEntry, edge.curve),
                )
                for edge in piece.edges
            ]
            legs = []
            for dart in piece.darts:
                lengths = [1000 * piece.edge(leg).length for leg in (dart.dart.left, dart.dart.right)]
                legs.append({**_told(DartEntry, dart.dart), **_told(DartEntry, dart, length_mm=lengths)})
            drafted = _told(
                PieceEntry,
                piece,
                edges=edges,
                darts=legs,
                notches=[_told(NotchEntry, notch, double=notch.double) for notch in piece.notches],
                cutouts={name: cutout.cut_line.tolist() for name, cutout in piece.cutouts.items()},
                cutout_sew_lines={name: cutout.sew_line.tolist() for name, cutout in piece.cutouts.items()},
                cutout_allowances={name: cutout.width for name, cutout in piece.cutouts.items()},
                fisheye_darts=_plain(piece.fisheyes),
                label=_told(
                    LabelEntry, label, lines=[t for t, _ in label.lines], heights=[height for _, height in label.lines]
                ),
            )
            entries[piece.name] = _told(
                PieceEntry,
                own,
                marks=sorted(own.marks),
                printed_units=own.units,
                on_fold=own.on_fold,
                **drafted,
            )
    return {
        "schema": SCHEMA,
        "warpflat": __version__,
        "units": "m",
        "name": garment.name,
        "sample_size": garment.sample,
        "words": dict(pattern.words),
        "sizes": sizes,
        "cut_list": {size: _plain(cut_list(pieces)) for size, pieces in garment.pieces.items()},
        "stitches": [
            *(_stitch(seam, "seam") for seam in pattern.seams),
            *(_stitch(dart, "dart") for dart in darts),
        ],
        "elastics": _plain(pattern.elastics),
        "worn": _plain(pattern.worn),
        "found_seams": [seam.as_dict() for seam in pattern.found_seams],
        "notes": list(pattern.notes),
        "seams": [_told(ReportEntry, report, matches=report.matches) for report in garment.seams],
    }


def write_pattern_json(garment: DraftedGarment, path: str | os.PathLike[str]) -> None:
    """Write :func:`pattern_json`; the file appears whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_json(pattern_json(garment), indent=1) + b"\n")


def _plain(value: Any) -> Any:
    """Return dataclasses, arrays and sequences, in each other too, as dicts and lists."""
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value


def _told(model: type[Entry], thing: Any, /, **given: Any) -> dict[str, Any]:
    """Return what an entry tells of an object: the fields that both have, by the keys of the file, and what is given."""
    own = {each.name for each in fields(thing)} - given.keys()
    keys = {name: field.alias or name for name, field in model.model_fields.items() if name in own}
    return {**{key: _plain(getattr(thing, name)) for name, key in keys.items()}, **given}


def _stitch(seam: Seam, kind: str) -> dict[str, Any]:
    sides = [
        [_told(SideEntry, side, **({"copy": side.copy} if side.copy else {})) for side in row] for row in seam.sides
    ]
    return _told(StitchEntry, seam, kind=kind, sides=sides)


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
        pieces = {size: tuple(piece.piece for piece in row) for size, row in drafted.items()}
        seams = list[Seam]()
        for stitch in (stitch for stitch in data.stitches if stitch.kind == "seam"):
            first, second = (
                tuple(_made(SeamSide, side, copy=side.copy_number) for side in row) for row in stitch.sides
            )
            seams.append(_made(Seam, stitch, sides=(first, second)))
        reports = tuple(_made(SeamReport, report) for report in data.seams)
        garment = _made(Pattern, data, pieces=pieces, seams=seams)
        return DraftedGarment(pattern=garment, pieces=drafted, seams=reports)
    except InputError as error:
        raise InputError(f"{error}; run the scene again") from None


Thing = TypeVar("Thing")


_hints: Any = cache(get_type_hints)


def _made(made: type[Thing], entry: Entry, /, **given: Any) -> Thing:
    """Return the object that an entry tells of: the fields that both have, as their types say, and what is given."""
    hints = _hints(made)
    names = [name for name in type(entry).model_fields if name in hints and name not in given]
    return made(**{name: _typed(hints[name], getattr(entry, name)) for name in names}, **given)


def _typed(hint: Any, value: Any) -> Any:
    """Return plain data as a type says: arrays, tuples and objects."""
    if isinstance(hint, UnionType):
        (hint,) = (each for each in get_args(hint) if each is not NoneType)
    if isinstance(value, Entry):
        return _made(hint, value)
    if isinstance(value, dict):
        return {key: _typed(get_args(hint)[1], each) for key, each in value.items()}
    if not isinstance(value, list):
        return value
    if get_origin(hint) is np.ndarray:
        return np.array(value)
    rows = [_typed(get_args(hint)[0], each) for each in value]
    return tuple(rows) if get_origin(hint) is tuple else rows


def _read_piece(name: str, size: str, data: PieceEntry) -> DraftedPiece:
    frame = np.array(data.frame)

    def in_mesh(points: Any) -> FloatArray:
        """Map points from the drafted piece's coordinates to those of the flat mesh."""
        return (np.array(points) / data.enlarged - frame[:, 2]) @ frame[:, :2]

    cutouts = {
        key: DraftedCutout(
            sew_line=np.array(data.cutout_sew_lines.get(key, line)),
            cut_line=np.array(line),
            width=data.cutout_allowances.get(key, 0.0),
        )
        for key, line in data.cutouts.items()
    }
    holes = [Hole(name=key, points=in_mesh(one.sew_line), allowance=one.width) for key, one in cutouts.items()]
    holes += [Hole(name=key, points=in_mesh(line), kind="dart") for key, line in data.fisheye_darts.items()]
    edges = [
        _made(
            Edge,
            edge,
            points=in_mesh(edge.line),
            allowance=None if edge.kind == "fold" else edge.allowance,
        )
        for edge in data.edges
    ]
    darts = [_made(Dart, dart, fold_to=dart.fold_to or None) for dart in data.darts]
    piece = _made(
        Piece,
        data,
        name=name,
        size=size,
        units=data.printed_units,
        edges=edges,
        darts=darts,
        holes=holes,
        internal_lines={key: in_mesh(line) for key, line in data.internal_lines.items()},
        marks={hole.name: in_mesh([hole.at])[0] for hole in data.drill_holes if hole.name in data.marks},
        grain=in_mesh(data.grain),
    )
    return _made(
        DraftedPiece,
        data,
        piece=piece,
        edges=tuple(
            _made(
                DraftedEdge,
                entry,
                edge=edge,
                curve=_made(Curve, entry),
                width=entry.allowance,
                places=np.array(entry.point_lengths),
            )
            for edge, entry in zip(edges, data.edges, strict=True)
        ),
        darts=tuple(_made(DraftedDart, entry, dart=dart) for dart, entry in zip(darts, data.darts, strict=True)),
        cutouts=cutouts,
        fisheyes={key: np.array(line) for key, line in data.fisheye_darts.items()},
        label=_made(Label, data.label, lines=tuple(zip(data.label.lines, data.label.heights, strict=True))),
    )
