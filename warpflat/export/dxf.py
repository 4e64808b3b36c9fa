"""Patterns as DXF for apparel CAD: the AAMA dialect (ANSI/AAMA-292) and ASTM D6673, both on DXF R12.

The file has an empty header, no tables and no layout blocks: some CAD systems refuse others. Layers are numbers: 1 boundary
and system text, 2 turn points, 3 curve points, 4 slit notches, 6 mirror line, 7 grain, 8 internal lines, 11 cutouts, 13 drill
holes, 14 sewing lines, 15 annotation; ASTM adds validation curves, 84 of the boundary and 87 of the sewing line.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime

import numpy as np

from warpflat._version import __version__
from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.output import atomic_path
from warpflat.core.polyline import turning_angles
from warpflat.core.source_date import source_date
from warpflat.core.text import control_in, plain_letters
from warpflat.export.grade_rules import grade_rules, write_rul
from warpflat.export.letters import titles
from warpflat.pattern.cut_list import cloths_of
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.layout import lay_out, nests
from warpflat.pattern.lettering import text_width
from warpflat.pattern.seam_words import seam_words

__all__ = ["block_name", "write_dxf"]


DIALECTS = ("aama", "astm")
#: File units per metre, by what the file says of itself.
UNITS = {"metric": 1000.0, "english": 1000.0 / 25.4}
#: A boundary vertex that turns by more than this [rad] is a turn point, else a curve point.
TURN = np.radians(12.0)
#: Height [m] of a piece's texts where there is room, and the distance of their rows as a multiple of it.
TEXT, ROW = 0.004, 1.75


def write_dxf(
    garment: DraftedGarment,
    path: str | os.PathLike[str],
    *,
    dialect: str = "aama",
    units: str = "metric",
    sizes: Sequence[str] | None = None,
    created: datetime | None = None,
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
        created: date and time for the file's text; None takes SOURCE_DATE_EPOCH, or the present.
        rul: the table of grade rules that is written for a nest; None writes none, nor any numbers.

    Raises:
        InputError: unknown dialect, units or size.
    """
    if dialect not in DIALECTS:
        raise InputError(f"unknown DXF dialect {dialect!r}; {nearest(dialect, DIALECTS)}")
    if units not in UNITS:
        raise InputError(f"unknown DXF units {units!r}; {nearest(units, UNITS)}")
    chosen = tuple(garment.pieces) if sizes is None else tuple(sizes)
    for size in chosen:
        garment.garment.piece(next(iter(garment.pieces.values()))[0].name, size)
    scale, created = UNITS[units], created or source_date()
    rules = grade_rules(garment, chosen) if rul is not None and len(chosen) > 1 else None
    blocks, space = list[str](), list[str]()
    groups = [tuple(p for p in nest if p.size in chosen) for nest in nests(garment)]
    taken: set[str] = set()
    seams = seam_words(garment.garment.seams)
    names = {piece.name: piece.piece.title or piece.name for piece in next(iter(garment.pieces.values()))}
    written = titles(list(dict.fromkeys(names.values())), _is_written)
    for placed in lay_out(groups, width=1.5).placed:
        for piece in placed.pieces:
            title = written[names[piece.name]]
            name = block_name(piece, taken, title)
            block = list[str]()
            _write_piece(block, piece, title, scale, seams, validation=dialect == "astm")
            for point in rules.points.get(piece.name, ()) if rules is not None and piece.size == rules.sample else ():
                _text(block, f"# {point.rule}", point.at, scale, point.layer, 0.003)
            begin = _tags((0, "BLOCK"), (8, "0"), (2, name), (70, 0), *_place((0.0, 0.0)), (3, name), (1, ""))
            blocks += [begin, *block, _tags((0, "ENDBLK"), (8, "0"))]
            space.append(_tags((0, "INSERT"), (8, "1"), (2, name), *_place(placed.offset * scale)))
    table = _ascii(garment.name)[:20]
    _write_style(space, garment, units, scale, created, table="" if rules is None else table)
    with atomic_path(path) as temporary, open(temporary, "w", encoding="ascii") as stream:
        for section, content in (("HEADER", []), ("BLOCKS", blocks), ("ENTITIES", space)):
            stream.write(_tags((0, "SECTION"), (2, section)) + "".join(content) + _tags((0, "ENDSEC")))
        stream.write(_tags((0, "EOF")))
    if rules is not None and rul is not None:
        write_rul(rules, rul, name=table, dialect=dialect, units=units, scale=scale, created=created)


def block_name(piece: DraftedPiece, taken: set[str], title: str = "") -> str:
    """Return a block name such as FRONT_BODICE_38 that is not in `taken`, to which it is added.

    R12 allows few characters. `title` stands for the piece's name where that has none of these.
    """
    text = f"{title or piece.name}_{piece.size}" if piece.size else title or piece.name
    clean = re.sub(r"[^A-Z0-9_$-]+", "_", _ascii(text).upper()).strip("_") or "PIECE"
    unique, count = clean, 1
    while unique in taken:
        count += 1
        unique = f"{clean}_{count}"
    taken.add(unique)
    return unique


def _ascii(text: str) -> str:
    """Return a text in 7 bits, as the standards demand: accents are dropped, other letters become "?"."""
    # Control characters too: a line of the file is a value.
    plain = plain_letters(text).encode("ascii", "replace").decode("ascii")
    return "".join("?" if control_in(letter) else letter for letter in plain) if control_in(plain) else plain


def _is_written(name: str) -> bool:
    """Return whether 7 bits leave anything of a name."""
    return any(letter.isalnum() for letter in _ascii(name))


def _write_piece(
    block: list[str],
    piece: DraftedPiece,
    title: str,
    scale: float,
    seams: Mapping[tuple[str, str], Sequence[str]],
    *,
    validation: bool,
) -> None:
    """Write all layers of one piece in one size."""
    boundary = _from_a_corner(piece.cut_line)
    _polyline(block, boundary, scale, "1", closed=True)
    for point, turns in zip(boundary, _is_corner(boundary), strict=True):
        _point(block, point, scale, "2" if turns else "3")
    _write_notches(block, piece, scale)
    _write_edges(block, piece, scale, seams)
    _line(block, piece.grain, scale, "7")
    for line in piece.internal_lines.values():
        _polyline(block, line, scale, "8")
    _write_darts(block, piece, scale)
    for cutout in piece.cutouts.values():
        _polyline(block, cutout.cut_line, scale, "11", closed=True)
        if cutout.width > 0:
            _polyline(block, cutout.sew_line, scale, "14", closed=True)
    for hole in piece.drill_holes:
        _point(block, hole.at, scale, "13")
    if validation:
        _polyline(block, boundary, scale, "84", closed=True)
        for edge in piece.edges:
            if edge.kind not in ("fold", "dart"):
                _polyline(block, edge.curve.sample(5e-6), scale, "87")
    _write_texts(block, piece, title, scale)


def _write_notches(block: list[str], piece: DraftedPiece, scale: float) -> None:
    """Write slit notches as points with their depth for height."""
    for notch in piece.notches:
        angle = float(np.degrees(np.arctan2(notch.direction[1], notch.direction[0]))) % 360.0
        for base in notch.base:
            location = (base[0] * scale, base[1] * scale, notch.depth * scale)
            block.append(_tags((0, "POINT"), (8, "4"), *_place(location), *([(50, angle)] if angle else [])))


def _write_edges(
    block: list[str], piece: DraftedPiece, scale: float, seams: Mapping[tuple[str, str], Sequence[str]]
) -> None:
    """Write the sewing line edge by edge, each with its name and, in rows below, what is sewn to it."""
    for edge in piece.edges:
        if edge.kind == "fold":
            _line(block, edge.line[[0, -1]], scale, "6")
        else:
            # The legs of a dart that is cut away are seams with an allowance, those of a folded one lie inside.
            line = piece.drawn_line(edge)
            _polyline(block, line, scale, "8" if edge.kind == "dart" and edge.width == 0 else "14")
        texts = [f"EDGE: {edge.name}", *(f"SEAM: {words}" for words in seams.get((piece.name, edge.name), ()))]
        middle = edge.line[len(edge.line) // 2] if len(edge.line) > 2 else edge.line.mean(axis=0)
        for row, text in enumerate(texts):
            _text(block, text, middle - [0.0, 0.003 * ROW * row], scale, "15", 0.003)


def _write_darts(block: list[str], piece: DraftedPiece, scale: float) -> None:
    """Write the folds of darts, fish-eye darts and their names."""
    for dart in piece.darts:
        if dart.fold is not None:
            _polyline(block, dart.fold, scale, "8")
        word = "DART" if dart.dart.pleat is None else "PLEAT"
        _text(block, f"{word}: {dart.dart.name}", dart.tip, scale, "15", 0.003)
    for name, line in piece.fisheyes.items():
        _polyline(block, line, scale, "8", closed=True)
        _text(block, f"DART: {name}", line.mean(axis=0), scale, "15", 0.003)


def _write_texts(block: list[str], piece: DraftedPiece, title: str, scale: float) -> None:
    """Write the system texts where the label has its room; notes may run on to the right."""
    texts = [f"PIECE NAME: {title}", f"SIZE: {piece.size}", f"QUANTITY: {piece.piece.quantity}"]
    texts += [f"CATEGORY: {'FOLD' if piece.piece.on_fold else 'PIECE'}", f"FABRIC: {' / '.join(cloths_of(piece))}"]
    texts += ["ANNOTATION: " + text.replace("\n", " ") for text, _ in piece.label.lines[2:3]]
    low, high = piece.label.box.min(axis=0), piece.label.box.max(axis=0)
    widest = max(text_width(text, 1.0) for text in texts)
    texts += [f"ANNOTATION: {note}" for note in piece.notes]
    height = min(TEXT, (high[0] - low[0]) / widest, (high[1] - low[1]) / len(texts) / ROW)
    for row, text in enumerate(texts):
        _text(block, text, np.array([low[0], high[1] - ROW * height * (row + 0.8)]), scale, "1", height)


def _write_style(
    space: list[str], garment: DraftedGarment, units: str, scale: float, created: datetime, *, table: str
) -> None:
    """Write the texts that describe the whole file."""
    texts = [
        f"STYLE NAME: {garment.name}",
        f"CREATION DATE: {created:%d-%m-%Y}",
        f"CREATION TIME: {created:%H:%M}",
        "AUTHOR: warpflat",
        f"SAMPLE SIZE: {garment.garment.sample}",
        *([f"GRADE RULE TABLE: {table}"] if table else []),
        f"UNITS: {units.upper()}",
        "PRODUCT: warpflat",
        f"VERSION: {__version__}",
    ]
    for row, text in enumerate(texts):
        _text(space, text, np.array([0.0, -0.010 * (row + 1)]), scale, "1", 0.005)


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


def _from_a_corner(ring: FloatArray) -> FloatArray:
    """Return a closed line that begins in a turn point, as CAD systems expect of a boundary."""
    corners = np.flatnonzero(_is_corner(ring))
    return np.roll(ring, -int(corners[0]), axis=0) if len(corners) else ring
