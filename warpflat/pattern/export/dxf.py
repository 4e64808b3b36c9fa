"""Patterns as DXF for apparel CAD: the AAMA dialect (ANSI/AAMA-292) and ASTM D6673, both on DXF R12.

The file has an empty header, no tables and no layout blocks: some CAD systems refuse others. Layers are numbers: 1 boundary
and system text, 2 turn points, 3 curve points, 4 slit notches, 6 mirror line, 7 grain, 8 internal lines, 11 cutouts, 13 drill
holes, 14 sewing lines, 15 annotation, 16 legs of pleats up to the tip, of which layer 8 has what is sewn; ASTM adds validation
curves, 84 of the boundary and 87 of the sewing line.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from warpflat._version import __version__
from warpflat.core import (
    BoolArray,
    FloatArray,
    InputError,
    control_in,
    find_unused_name,
    nearest,
    resample,
    turning_angles,
)
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.label import text_width
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.drafting.measures import INCH
from warpflat.pattern.drafting.seam_words import seam_words
from warpflat.pattern.export.letters import plain_letters, titles
from warpflat.pattern.files.output import atomic_path
from warpflat.pattern.files.source_date import source_date

__all__ = ["block_name", "write_dxf"]


DIALECTS = ("aama", "astm")
#: File units per metre, by what the file says of itself.
UNITS = {"metric": 1000.0, "english": 1.0 / INCH}
#: A boundary vertex that turns by more than this [rad] is a turn point, else a curve point.
TURN = np.radians(12.0)
#: Height [m] of a piece's texts where there is room, that of names within it, and the distance of rows as a multiple of it.
TEXT, NAME, ROW = 0.004, 0.003, 1.75


def write_dxf(
    garment: DraftedGarment,
    path: str | os.PathLike[str],
    *,
    dialect: str = "aama",
    units: str = "metric",
    sizes: Sequence[str] | None = None,
    rul: str | os.PathLike[str] | None = None,
) -> None:
    """Write all pieces, one block per piece and size, in one file (a graded nest where there are several sizes).

    The sample size of a nest has the numbers of its grade rules beside its points ("# 7"), and the rules are a table of their own.

    Args:
        garment: drafted.
        path: of the file.
        dialect: "aama" (which most systems read) or "astm".
        units: "metric" (millimetres) or "english" (inches).
        sizes: those to write; None writes all.
        rul: the table of grade rules that is written for a nest; None writes none, nor any numbers.

    Raises:
        InputError: unknown dialect, units or size.
    """
    if dialect not in DIALECTS:
        raise InputError(f"unknown DXF dialect {dialect!r}; {nearest(dialect, DIALECTS)}")
    if units not in UNITS:
        raise InputError(f"unknown DXF units {units!r}; {nearest(units, UNITS)}")
    garment, scale, created = garment.of_sizes(sizes), UNITS[units], source_date()
    rules = grade_rules(garment) if rul is not None and len(garment.pieces) > 1 else None
    blocks, space, taken = list[str](), list[str](), set[str]()
    seams = seam_words(garment.pattern.seams)
    names = {piece.name: piece.piece.title or piece.name for piece in garment}
    written = titles(list(dict.fromkeys(names.values())), lambda name: any(map(str.isalnum, _ascii(name))))
    for placed in lay_out(nests(garment)).placed:
        for piece in placed.pieces:
            title, cloths = written[names[piece.name]], piece.piece.cloths
            name = block_name(piece, taken, title)
            block = _lines(piece, scale, seams, dialect)
            # The system texts stand where the label has its room.
            texts = [
                f"PIECE NAME: {title}",
                f"SIZE: {piece.size}",
                f"QUANTITY: {cloths[piece.piece.fabric]}",
                f"CATEGORY: {'FOLD' if piece.piece.on_fold else 'PIECE'}",
                f"FABRIC: {' / '.join(cloths)}",
                *(
                    "ANNOTATION: " + text.replace("\n", " ")
                    # How often it is cut, from each of its cloths.
                    for text, _ in piece.label.lines[1 + bool(piece.size) :][: len(cloths)]
                ),
            ]
            low, high = piece.label.box.min(axis=0), piece.label.box.max(axis=0)
            widest = max(text_width(text, 1.0) for text in texts)
            # Notes may run on to the right.
            texts += [f"ANNOTATION: {note}" for note in piece.notes]
            height = min(TEXT, (high[0] - low[0]) / widest, (high[1] - low[1]) / len(texts) / ROW)
            for row, text in enumerate(texts):
                _text(block, text, np.array([low[0], high[1] - ROW * height * (row + 0.8)]), scale, "1", height)
            for point in rules.points.get(piece.name, ()) if rules is not None and piece.size == rules.sample else ():
                _text(block, f"# {point.rule}", point.at, scale, point.layer, NAME)
            begin = _tags((0, "BLOCK"), (8, "0"), (2, name), (70, 0), *_place((0.0, 0.0)), (3, name), (1, ""))
            blocks += [begin, *block, _tags((0, "ENDBLK"), (8, "0"))]
            space.append(_tags((0, "INSERT"), (8, "1"), (2, name), *_place(placed.offset * scale)))
    table, program = _ascii(garment.name)[:20], ["AUTHOR: warpflat", "PRODUCT: warpflat", f"VERSION: {__version__}"]
    made = [f"CREATION DATE: {created:%d-%m-%Y}", f"CREATION TIME: {created:%H:%M}"]
    style = [
        f"STYLE NAME: {garment.name}",
        *made,
        program[0],
        f"SAMPLE SIZE: {garment.sample}",
        *([f"GRADE RULE TABLE: {table}"] if rules is not None and table else []),
        f"UNITS: {units.upper()}",
        *program[1:],
    ]
    for row, text in enumerate(style):
        _text(space, text, np.array([0.0, -0.010 * (row + 1)]), scale, "1", 0.005)
    with atomic_path(path) as temporary, open(temporary, "w", encoding="ascii") as stream:
        for section, content in (("HEADER", []), ("BLOCKS", blocks), ("ENTITIES", space)):
            stream.write(_tags((0, "SECTION"), (2, section)) + "".join(content) + _tags((0, "ENDSEC")))
        stream.write(_tags((0, "EOF")))
    if rules is not None and rul is not None:
        version = "ANSI/AAMA VERSION: 1.0.0" if dialect == "aama" else "ASTM/D13 Proposal 1 Version: D6673-10"
        head = [version, *program, *made, f"UNITS: {units.upper()}", f"GRADE RULE TABLE: {table}"]
        text = "\r\n".join([*head, *rules.table(scale), "END", ""])
        with atomic_path(rul) as temporary:
            temporary.write_bytes(text.encode("ascii", "replace"))


def _lines(
    piece: DraftedPiece, scale: float, seams: Mapping[tuple[str, str], Sequence[str]], dialect: str
) -> list[str]:
    """Return the lines and points of a piece in units of the file, and at its edges, lines and darts their names.

    Below the name of an edge stands its kind, if it is a hem or stays raw, and what is sewn to it.
    """
    block = list[str]()
    corners = np.flatnonzero(_is_corner(piece.cut_line))
    boundary = np.roll(piece.cut_line, -int(corners[0]), axis=0) if len(corners) else piece.cut_line
    _polyline(block, boundary, scale, "1", closed=True)
    for point, turns in zip(boundary, _is_corner(boundary), strict=True):
        _point(block, point, scale, "2" if turns else "3")
    # Slit notches are points with their depth for height.
    for notch in piece.notches:
        angle = float(np.degrees(np.arctan2(notch.direction[1], notch.direction[0]))) % 360.0
        for base in notch.base:
            location = (base[0] * scale, base[1] * scale, notch.depth * scale)
            block.append(_tags((0, "POINT"), (8, "4"), *_place(location), *([(50, angle)] if angle else [])))
    for edge in piece.edges:
        if edge.kind == "fold":
            _line(block, edge.line[[0, -1]], scale, "6")
        else:
            # The legs of a dart that is cut away are seams with an allowance, those of a folded one lie inside.
            line = piece.drawn_line(edge)
            _polyline(block, line, scale, "8" if edge.kind == "dart" and edge.width == 0 else "14")
            if line is not edge.line:
                _polyline(block, edge.line, scale, "16")
        # Layers tell folds and darts.
        kind = [f"KIND: {edge.kind}"] if edge.kind in ("hem", "cut") else []
        sewn = [f"SEAM: {words}" for words in seams.get((piece.name, edge.name), ())]
        texts = [f"EDGE: {edge.name}", *kind, *sewn]
        middle = edge.line[len(edge.line) // 2] if len(edge.line) > 2 else edge.line.mean(axis=0)
        for row, text in enumerate(texts):
            _text(block, text, middle - [0.0, NAME * ROW * row], scale, "15", NAME)
    _line(block, piece.grain, scale, "7")
    for name, line in piece.internal_lines.items():
        _polyline(block, line, scale, "8")
        _text(block, f"LINE: {name}", line[len(line) // 2], scale, "15", NAME)
    for dart in piece.darts:
        if dart.fold is not None:
            _polyline(block, dart.fold, scale, "8")
        word = "DART" if dart.dart.pleat is None else "PLEAT"
        _text(block, f"{word}: {dart.dart.name}", dart.tip, scale, "15", NAME)
    for name, line in piece.fisheyes.items():
        _polyline(block, line, scale, "8", closed=True)
        _text(block, f"DART: {name}", line.mean(axis=0), scale, "15", NAME)
    for cutout in piece.cutouts.values():
        _polyline(block, cutout.cut_line, scale, "11", closed=True)
        if cutout.width > 0:
            _polyline(block, cutout.sew_line, scale, "14", closed=True)
    for hole in piece.drill_holes:
        _point(block, hole.at, scale, "13")
    if dialect == "astm":
        _polyline(block, boundary, scale, "84", closed=True)
        for edge in (edge for edge in piece.edges if edge.kind not in ("fold", "dart")):
            _polyline(block, edge.curve.sample(5e-6), scale, "87")
    return block


def block_name(piece: DraftedPiece, taken: set[str], title: str = "") -> str:
    """Return a block name such as FRONT_BODICE_38 that is not in `taken`, to which it is added.

    R12 allows few characters. `title` stands for the piece's name where that has none of these.
    """
    text = f"{title or piece.name}_{piece.size}" if piece.size else title or piece.name
    clean = re.sub(r"[^A-Z0-9_$-]+", "_", _ascii(text).upper()).strip("_") or "PIECE"
    unique = find_unused_name(clean, taken, joint="_")
    taken.add(unique)
    return unique


def _ascii(text: str) -> str:
    """Return a text in 7 bits, as the standards demand: accents are dropped, other letters become "?"."""
    # Control characters too: a line of the file is a value.
    plain = plain_letters(text).encode("ascii", "replace").decode("ascii")
    return "".join("?" if control_in(letter) else letter for letter in plain) if control_in(plain) else plain


def _polyline(block: list[str], points: FloatArray, scale: float, layer: str, *, closed: bool = False) -> None:
    block.append(_tags((0, "POLYLINE"), (8, layer), (66, 1), *_place((0.0, 0.0)), (70, int(closed))))
    for x, y in (points * scale).tolist():
        block.append(f"  0\nVERTEX\n  8\n{layer}\n 10\n{x}\n 20\n{y}\n 30\n0.0\n 70\n0\n")
    block.append(_tags((0, "SEQEND"), (8, layer)))


def _line(block: list[str], ends: FloatArray, scale: float, layer: str) -> None:
    start, end = ends * scale
    block.append(_tags((0, "LINE"), (8, layer), *_place(start), *_place(end, 1)))


def _point(block: list[str], at: FloatArray, scale: float, layer: str) -> None:
    block.append(_tags((0, "POINT"), (8, layer), *_place(at * scale)))


def _text(block: list[str], text: str, at: FloatArray, scale: float, layer: str, height: float) -> None:
    place = at * scale
    size_and_words = (40, float(height * scale)), (1, _ascii(text))
    block.append(_tags((0, "TEXT"), (8, layer), *_place(place), *size_and_words, *_place(place, 1)))


def _place(point: Iterable[float], number: int = 0) -> list[tuple[int, float]]:
    """Return the tags of an entity's first place, or of the one with this number, from 2 or 3 coordinates."""
    x, y, z = (*(float(value) for value in point), 0.0)[:3]
    return [(10 + number, x), (20 + number, y), (30 + number, z)]


def _tags(*tags: tuple[int, object]) -> str:
    """Return tags as the file has them: a line with the code, and one with the value."""
    return "".join(f"{code:3}\n{value}\n" for code, value in tags)


def _is_corner(ring: FloatArray) -> BoolArray:
    """Return which points of a closed line (#P) are turn points."""
    around = np.concatenate([ring[-1:], ring, ring[:1]])
    return np.asarray(np.abs(turning_angles(around)) > TURN)


#: Grade points between the corners of a curved edge, by their shares of its length.
_BETWEEN = (0.25, 0.5, 0.75)
#: An edge whose chord is shorter than it by less than this share is straight.
_STRAIGHT = 1e-4
#: Moves that differ by less than this [m] are one rule.
_SAME = 5e-6
#: Pairs in a line of a table.
_IN_LINE = 4


@dataclass(frozen=True, kw_only=True)
class GradePoint:
    """A graded point of the sample size.

    Attributes:
        at: its place [m] in the drafted piece.
        rule: number of its rule.
        layer: "2" on the boundary, "4" at a notch, "13" at a drill hole.
    """

    at: FloatArray
    rule: int
    layer: str


@dataclass(kw_only=True)
class GradeRules:
    """The rules of a garment, and its graded points.

    Attributes:
        sizes: in their order.
        sample: the size that is graded.
        moves: by rule, from 1 on: #sizes by 2 [m], from the sample size's point to each size's; x and y as drawn.
        points: by piece.
    """

    sizes: tuple[str, ...]
    sample: str
    moves: list[FloatArray] = field(default_factory=list)
    points: dict[str, list[GradePoint]] = field(default_factory=dict)

    def table(self, scale: float) -> list[str]:
        """Return the lines of the table of sizes and rules, in units of the file."""
        lines = [
            f"NUMBER OF SIZES: {len(self.sizes)}",
            f"SIZE LIST: {' '.join(size.replace(' ', '_') for size in self.sizes)}",
            f"SAMPLE SIZE: {self.sample.replace(' ', '_')}",
        ]
        for number, moves in enumerate(self.moves, 1):
            lines.append(f"RULE: DELTA {number}")
            pairs = [f"{x:>10.3f},{y:>9.3f}" for x, y in (moves * scale + 0.0).tolist()]
            lines += ["".join(pairs[k : k + _IN_LINE]) for k in range(0, len(pairs), _IN_LINE)]
        return lines

    def rule(self, moves: FloatArray) -> int:
        """Return the number of a rule, a new one if there is none alike."""
        for number, known in enumerate(self.moves, 1):
            if np.abs(known - moves).max() < _SAME:
                return number
        self.moves.append(moves)
        return len(self.moves)


def grade_rules(garment: DraftedGarment) -> GradeRules:
    """Return the grade rules of a nest, from the sample size to each size: rule 1 moves nothing.

    Graded are the corners of the cutting line, places between them on curved edges, notches and drill holes; each is the same
    place in every size. A place, or a piece, that some size does not have is not graded.
    """
    rules = GradeRules(sizes=tuple(garment.pieces), sample=garment.sample)
    rules.rule(np.zeros((len(rules.sizes), 2)))
    for piece in garment.pieces[rules.sample]:
        all_sizes = garment.all_sizes(piece.name)
        if len(all_sizes) < len(rules.sizes):
            continue
        rows = [_places(each) for each in all_sizes]
        graded = rows[rules.sizes.index(rules.sample)]
        for key, at in graded.items():
            if all(key in row for row in rows):
                moves = np.array([row[key] - at for row in rows])
                number = rules.rule(moves)
                rules.points.setdefault(piece.name, []).append(GradePoint(at=at, rule=number, layer=key[0]))
    return rules


def _places(piece: DraftedPiece) -> dict[tuple[str, str, float], FloatArray]:
    """Return the places of one piece that are graded, by layer, name and number."""
    found: dict[tuple[str, str, float], FloatArray] = {}
    for edge in piece.edges:
        if edge.kind == "dart" and edge.width == 0:
            continue
        chord = float(np.linalg.norm(edge.line[-1] - edge.line[0]))
        for share in (0.0, *(_BETWEEN if chord < edge.length * (1.0 - _STRAIGHT) else ())):
            found["2", edge.name, share] = _on_cut_line(edge.line, share, edge.width, piece.cut_line)
    counts: dict[str, int] = {}
    for notch in piece.notches:
        for base in notch.base:
            number = counts[notch.seam] = counts.get(notch.seam, 0) + 1
            found["4", notch.seam, float(number)] = base
    for number, hole in enumerate(piece.drill_holes):
        found["13", hole.name, float(number)] = hole.at
    return found


def _on_cut_line(points: FloatArray, share: float, width: float, ring: FloatArray) -> FloatArray:
    """Return the place on the cutting line beside a place of the sewing line; at a corner its nearest corner."""
    import shapely

    at = resample(points, share)
    if share == 0.0:
        corners = ring[_is_corner(ring)]
        away = np.linalg.norm(corners - at, axis=1)
        if away.min(initial=np.inf) < 4.0 * max(width, 0.012):
            return np.asarray(corners[away.argmin()])
    line = shapely.LinearRing(ring)
    return np.asarray(line.interpolate(line.project(shapely.Point(at))).coords[0])
