"""Patterns read from DXF of apparel CAD: the package's own, with the names of edges and seams, and other programs'."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core import FARTHEST, FloatArray, InputError, Place, find_unused_name, plain_label, quote_value, reading
from warpflat.pattern.drafting.corners import find_corners
from warpflat.pattern.drafting.curves import CHORD
from warpflat.pattern.drafting.measures import INCH
from warpflat.pattern.drafting.outline_edges import (
    boundary_edges,
    named_outline,
    split_outline,
    with_drawn_allowances,
)
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.seam_words import seams_of_words
from warpflat.pattern.export.outlines import (
    ENDS_MEET,
    MOST_POINTS,
    TOO_MANY,
    DrawnLine,
    boundary_pieces,
    by_size,
    close_lines,
    counted,
    find_outlines,
    left_out,
    read_grain,
    read_quantity,
    simple_ring,
)

__all__ = ["read_dxf"]

_METRES = {"METRIC": 1e-3, "ENGLISH": INCH}
# The header's $INSUNITS, where no text names the units: inches, feet, millimetres, centimetres, metres.
_METRES_OF_HEADER = {1: INCH, 2: 12 * INCH, 4: 1e-3, 5: 1e-2, 6: 1.0}
# Layers of AAMA and ASTM; what is drawn on the others belongs to a piece, or checks it.
_BOUNDARY, _FOLD, _GRAIN, _INNER, _SEWING = "1", "6", "7", "8", "14"
# On a layer of the package's own: a pleat's legs up to its tip.
_LEG = "16"
# The layers of a piece that are not read, and what lies on them.
_NOT_READ = {"4": "notch", "8": "inner line", "11": "inner cut", "13": "drill hole"}
_LINES = ("POLYLINE", "LWPOLYLINE", "LINE", "ARC", "CIRCLE", "SPLINE", "ELLIPSE")
_WORDS = ("TEXT", "MTEXT", "ATTRIB", "ATTDEF", "POINT")


@dataclass
class _Block:
    """What a block holds: lines [m] by layer, points [m] by layer, texts by layer in their order, and kinds that are not read."""

    name: str = ""
    lines: dict[str, list[DrawnLine]] = field(default_factory=dict)
    points: dict[str, list[FloatArray]] = field(default_factory=dict)
    texts: list[tuple[str, str, FloatArray]] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    count: int = 0

    @property
    def all_lines(self) -> list[DrawnLine]:
        return [line for row in self.lines.values() for line in row]

    @property
    def drawn(self) -> bool:
        """Whether it holds a boundary, or a sewing line, as AAMA and ASTM have them."""
        return bool(self.lines.get(_BOUNDARY) or self.lines.get(_SEWING))

    def value(self, key: str) -> str:
        """Return what stands behind a key such as "PIECE NAME", in whichever case."""
        found = (text.partition(":") for _, text, _ in self.texts)
        return next((value.strip() for name, _, value in found if name.strip().upper() == key), "")


def read_dxf(path: str | os.PathLike[str], *, allowance: float | None = None) -> Pattern:
    """Read the pieces of a pattern; the seams too, where the file names them as the package does.

    A block is a piece. Its sewing line is on layer 14, its boundary on layer 1, its grain on layer 7. A line of symmetry on layer 6
    along its outline is the fold on which the piece lies; an outline that is open there is closed by it. In a file without such
    layers every closed line of an inserted block, or of a drawing without blocks, is a piece, as `export.outlines` says.
    A line may be made of several lines, arcs and splines. Units are those of the text UNITS, of the header, or else millimetres.

    Args:
        path: of the file.
        allowance: from the boundary to the sewing line [m] where a piece has no sewing line; none if not given.

    Raises:
        InputError: the file cannot be read, has no piece, or an outline does not close.
    """
    path = Path(path)
    with reading(path, "DXF") as place:
        from ezdxf import recover

        # Its log goes nowhere, but to the handlers of a program that has its own.
        logging.getLogger("ezdxf").addHandler(logging.NullHandler())
        document: Any = recover.readfile(str(path))[0]
        space = document.modelspace()
        layouts = [("", space), *((block.name, block) for block in document.blocks if not block.name.startswith("*"))]
        texts = [
            str(entity.dxf.text if entity.dxftype() == "TEXT" else entity.plain_text())
            for _, entities in layouts
            for entity in entities
            if entity.dxftype() in ("TEXT", "MTEXT")
        ]
        units = next(
            (value for key, _, value in (text.partition(":") for text in texts) if key.strip().upper() == "UNITS"), ""
        )
        metres = _METRES.get(units.strip().upper(), _METRES_OF_HEADER.get(document.header.get("$INSUNITS", 0), 1e-3))
        inserts = [entity for entity in space if entity.dxftype() == "INSERT"]
        inserted = {entity.dxf.name: entity for entity in inserts[::-1]}
        blocks, total = list[_Block](), 0
        for name, entities in layouts:
            block = _read_block(name, entities, inserted.get(name), metres, MOST_POINTS - total, place)
            total += block.count
            blocks.append(block)
        place.at = ""
        style, blocks = blocks[0], blocks[1:]
        pieces, notes, unread, taken = list[Piece](), list[str](), list[str](), set[tuple[str, str]]()
        words = dict[tuple[str, str], list[tuple[str, str, str]]]()
        # Other programs draw on layers of their own; a block that is not in the drawing, such as an arrow, is no piece then.
        # What is drawn as a part of other blocks alone is none, too.
        parts = {e.dxf.name for name, entities in layouts if name for e in entities if e.dxftype() == "INSERT"}
        named = [block for block in blocks if block.drawn and block.name not in parts - inserted.keys()]
        for block in named or [block for block in blocks if block.name in inserted and block.all_lines]:
            pieces += _pieces(block, allowance, words, str(path), taken, notes, unread)
        if style.all_lines:
            pieces += _loose_pieces(style, allowance, str(path), taken, notes)
        if not pieces:
            raise InputError(f"{path}: has no closed line; a piece is a closed line on layer 1 of a block")
        others = [
            block.name
            for block in blocks
            if named and block not in named and block.name in inserted and block.all_lines
        ]
        if others:
            notes.append(f"blocks without a boundary on layer 1 were left out: {', '.join(map(quote_value, others))}")
        if unread:
            notes.append(f"what belongs to pieces and is not read: {counted(unread)}")
        if kinds := [kind for block in (style, *blocks) for kind in block.unread]:
            notes.append(f"what is no line was left out: {counted(kinds)}")
        sizes = by_size(pieces)
        if "" in sizes and len(sizes) > 1:
            # A piece without a size is cut for all.
            for piece in sizes.pop(""):
                for size, row in sizes.items():
                    name = find_unused_name(piece.name, {other.name for other in row})
                    row.append(replace(piece, name=name, size=size))
        first = next(iter(sizes))
        seams = seams_of_words(entry for (size, _), rows in words.items() if size == first for entry in rows)
        sample = style.value("SAMPLE SIZE")
        pattern = Pattern(
            name=style.value("STYLE NAME") or path.stem, pieces=sizes, seams=seams,
            sample_size=sample if sample in sizes else None,
        )  # fmt: skip
        for name in pattern.piece_names:
            own = [size for size, row in sizes.items() if any(piece.name == name for piece in row)]
            if len(own) < len(sizes):
                notes.append(f"piece {quote_value(name)} is in size {', '.join(own)} only")
        return replace(pattern, notes=notes)


def _read_block(name: str, entities: Iterable[Any], insert: Any, metres: float, most: int, place: Place) -> _Block:
    """Return what a block holds, scaled and turned as it is inserted, with the blocks that lie in it; of the drawing only its own.

    Raises:
        InputError: a coordinate is no number or far off, or there are more than `most` points or entities.
    """
    from ezdxf.disassemble import recursive_decompose

    found, turn = _Block(name), metres * np.eye(2)
    if insert is not None:
        axes = insert.matrix44()
        turn = metres * np.array([list(axes.ux)[:2], list(axes.uy)[:2]], dtype=np.float64)
        if not np.isfinite(turn).all() or abs(np.linalg.det(turn)) < 1e-18:
            raise InputError(f"block {quote_value(name)} is inserted without a size")
    own = entities if name else (each for each in entities if each.dxftype() != "INSERT")
    for entity in recursive_decompose(own):
        kind, layer = entity.dxftype(), str(entity.dxf.get("layer", "0"))
        layer = layer.lstrip("0") or "0" if layer.isdigit() else layer
        place.at = f"{kind} on layer {quote_value(layer)}"
        found.count += 1
        if found.count > most:
            raise InputError(TOO_MANY)
        if kind in _WORDS:
            at = np.array(tuple(entity.dxf.location if kind == "POINT" else entity.dxf.insert)[:2]) @ turn
            if not np.isfinite(at).all():
                raise InputError("its place is no number")
            if kind == "POINT":
                found.points.setdefault(layer, []).append(at)
            else:
                text = entity.plain_text() if kind == "MTEXT" else entity.dxf.text
                found.texts.append((layer, str(text).strip(), at))
        elif kind in _LINES:
            line = _line(entity, turn, metres, most - found.count)
            found.count += len(line.points) if line else 0
            if line:
                found.lines.setdefault(layer, []).append(line)
        elif kind not in ("SEQEND", "VIEWPORT"):
            found.unread.append(kind)
    return found


def _line(entity: Any, turn: FloatArray, metres: float, most: int) -> DrawnLine | None:
    """Return a line, its curves flattened, in metres; None where it has no length.

    Raises:
        InputError: a coordinate is no number or far off, or it has more than `most` points.
    """
    from ezdxf.path import make_path

    kind = entity.dxftype()
    if kind == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise InputError("is a surface, not a line; a pattern is drawn with lines in the plane")
    if kind == "SPLINE" and max(len(entity.control_points), len(entity.fit_points)) < 2:
        return None
    path = make_path(entity)
    corners = np.array([tuple(corner) for corner in path.control_vertices()]).reshape(-1, 3)
    if (
        not np.isfinite(corners).all()
        or np.abs(corners[:, :2] @ turn).max(initial=0.0) > FARTHEST
        or (np.abs(corners * metres).max(initial=0.0) > FARTHEST)
    ):
        raise InputError(f"reaches farther than {FARTHEST:g} m, or has a coordinate that is no number")
    # At once all points of a curve would take gigabytes.
    scale = float(np.sqrt(np.abs(np.linalg.det(turn))))
    flat = islice(path.flattening(CHORD / scale), most + 1)
    points = np.array([tuple(point)[:2] for point in flat]).reshape(-1, 2) @ turn
    if len(points) > most:
        raise InputError(TOO_MANY)
    points = points[np.linalg.norm(np.diff(points, axis=0, prepend=np.inf), axis=1) > 1e-9]
    closed = len(points) > 2 and bool(np.linalg.norm(points[0] - points[-1]) < ENDS_MEET)
    points = points[:-1] if closed else points
    return DrawnLine(points=points, closed=closed) if len(points) > 1 else None


def _pieces(
    block: _Block,
    allowance: float | None,
    words: dict[tuple[str, str], list[tuple[str, str, str]]],
    path: str,
    taken: set[tuple[str, str]],
    notes: list[str],
    unread: list[str],
) -> list[Piece]:
    """Return the pieces of a block, one but where it has more outlines.

    Args:
        block: what is drawn.
        allowance: [m], where it has no sewing line.
        words: what is sewn to its edges is added, by size and piece.
        path: what messages begin with.
        taken: sizes and names of pieces before it; its own are added.
        notes: what was left out is added.
        unread: kinds of what belongs to the piece but is not read are added.

    Raises:
        InputError: an outline does not close.
    """
    where = f"{path}: {block.name}"
    size, quantity = plain_label(block.value("SIZE")), read_quantity(block.value("QUANTITY").split(",")[0])
    title = plain_label(block.value("PIECE NAME") or block.name)
    # The lines beside which a name stands, with their kind, and what is sewn to them.
    lines = [(layer, line.path) for layer in (_SEWING, _INNER, _FOLD, _LEG) for line in block.lines.get(layer, [])]
    parts, sewn, last = list[tuple[str, str, FloatArray]](), list[tuple[str, str]](), ""
    # The name stands on the middle point of its line, and on no other line's.
    middles = np.array(
        [(points[len(points) // 2] if len(points) > 2 else points.mean(axis=0)) for _, points in lines]
    ).reshape(-1, 2)
    for _, text, at in block.texts:
        if text.startswith("EDGE: ") and len(parts) < len(lines):
            last = text.removeprefix("EDGE: ")
            nearest_line = int(np.linalg.norm(middles - at, axis=1).argmin())
            middles[nearest_line] = np.inf
            layer, points = lines[nearest_line]
            parts.append((last, {_FOLD: "fold", _INNER: "dart", _LEG: "dart"}.get(layer, "seam"), points))
        elif text in ("KIND: hem", "KIND: cut") and parts:
            parts[-1] = last, text.removeprefix("KIND: "), parts[-1][2]
        elif text.startswith("SEAM: ") and last:
            sewn.append((last, text.removeprefix("SEAM: ")))
    tips = {text.partition(": ")[2]: at for _, text, at in block.texts if text.startswith(("DART: ", "PLEAT: "))}
    # The legs of a dart that is cut away are on the layer of seams.
    for number, (edge, kind, points) in enumerate(parts):
        ends_at_tip = any(np.linalg.norm(points[end] - tip) < 1e-6 for tip in tips.values() for end in (0, -1))
        if kind == "seam" and ends_at_tip:
            parts[number] = edge, "dart", points
    grain = next((read_grain(line) for line in block.lines.get(_GRAIN, []) if not line.closed), None)
    found, darts, eyes, cloths = list[list[Edge]](), list[Dart](), list[Hole](), [block.value("FABRIC")]
    inner = block.lines.get(_INNER, [])
    if parts:
        # The name of a fish-eye dart stands in the middle of its points.
        for line in (line for line in inner if line.closed):
            names = [name for name, tip in tips.items() if np.linalg.norm(line.points.mean(axis=0) - tip) < ENDS_MEET]
            eyes += [Hole(name=name, points=line.points, kind="dart") for name in names]
        legs = [line.points for line in inner if not line.closed]
        cutting = [line.path for line in block.lines.get(_BOUNDARY, [])]
        edges, darts = named_outline(parts, tips, legs, cutting, where)
        found, cloths = [edges], cloths[0].split(" / ")
    else:
        outlines, lost = _outlines(block, where)
        notes += [f"{block.name}: {note}" for note in lost]
        found = [_edges_without_names(block, ring, allowance, where, notes) for ring in outlines]
    for layer, what in _NOT_READ.items():
        drawn = len(block.points.get(layer, []) or block.lines.get(layer, []))
        # The package names its inner lines.
        named = sum(text.startswith("LINE: ") for _, text, _ in block.texts)
        unread += [what] * (named if parts and layer == _INNER else drawn)
    pieces = list[Piece]()
    for edges in found:
        name = find_unused_name(title, {other for of, other in taken if of == size})
        taken.add((size, name))
        words[size, name] = [(name, edge, text) for edge, text in sewn]
        pieces.append(
            Piece(
                name=name,
                size=size,
                edges=edges,
                darts=darts,
                holes=eyes,
                quantity=quantity,
                grain=grain,
                fabric=plain_label(cloths[0]),
                also={plain_label(cloth): quantity for cloth in cloths[1:]},
            )
        )
    return pieces


def _loose_pieces(
    style: _Block, allowance: float | None, path: str, taken: set[tuple[str, str]], notes: list[str]
) -> list[Piece]:
    """Return the pieces that are drawn beside all blocks, "piece_1" and so on; arguments as those of `_pieces`.

    Beside pieces that are blocks only what lies on layer 1 is a piece.
    """
    lines = style.lines.get(_BOUNDARY, []) if style.drawn else style.all_lines
    found, lost = find_outlines(lines, path)
    notes += lost
    if taken and not style.drawn:
        notes += [left_out([ring.name for ring in found], "closed line", " beside the blocks")] if found else []
        return []
    return boundary_pieces(found, allowance, path, {name for _, name in taken})


def _fold(block: _Block) -> FloatArray | None:
    """Return the line of symmetry of a block, 2 by 2 [m]: a straight one on layer 6."""
    lines = [line.points[[0, -1]] for line in block.lines.get(_FOLD, []) if not line.closed]
    return max(lines, key=lambda line: float(np.linalg.norm(line[1] - line[0])), default=None)


def _outlines(block: _Block, where: str) -> tuple[list[FloatArray], list[str]]:
    """Return the outer lines of a block (#P by 2 [m] each), and what was left out of it.

    Raises:
        InputError: there is none, or one does not close.
    """
    lines = block.lines.get(_BOUNDARY) or block.lines.get(_SEWING) if block.drawn else block.all_lines
    found, lost = find_outlines(lines or [], where, fold=_fold(block))
    if not found:
        raise InputError(
            f"{where}: its outline is open{_gap(close_lines(lines or []).chains)}; a boundary is a closed line on layer 1, or "
            "closed by a line of symmetry on layer 6"
        )
    return [ring.points for ring in found], lost


def _gap(chains: Sequence[DrawnLine]) -> str:
    """Return in words by how much the longest of open lines does not close; "" without any."""
    gaps = [float(np.linalg.norm(chain.points[-1] - chain.points[0])) for chain in chains]
    return f" by {1e3 * max(gaps):.1f} mm" if gaps else ""


def _edges_without_names(
    block: _Block, ring: FloatArray, allowance: float | None, where: str, notes: list[str]
) -> list[Edge]:
    """Return the edges of a piece whose file names none, within an outer line (#P by 2 [m]): of its sewing line, if it has one.

    A sewing line that does not close is named in the notes.
    """
    import shapely

    fold, outer = _fold(block), shapely.Polygon(ring).buffer(ENDS_MEET)
    sewing = block.lines.get(_SEWING, []) if block.lines.get(_BOUNDARY) else []
    joined = close_lines(sewing, fold)
    inner = [line.points for line in joined.rings]
    inner = [
        simple_ring(points, where) for points in inner if outer.covers(shapely.Polygon(points).representative_point())
    ]
    if inner:
        sewn = max(inner, key=lambda points: shapely.Polygon(points).area)
        # Its lines meet at corners, if they are curves.
        ends = [line.points[[0, -1]] for line in sewing if not line.closed and len(line.points) > 2]
        corners = np.concatenate([sewn[sorted(find_corners(sewn))], *ends])
        return with_drawn_allowances(split_outline(sewn, corners, fold), [np.concatenate([ring, ring[:1]])])
    if joined.chains:
        notes.append(
            f"{block.name}: its sewing line on layer 14 is open{_gap(joined.chains)} and was left out: the outline is its boundary"
        )
    if not block.lines.get(_BOUNDARY):
        return split_outline(ring, None, fold)
    corners = np.array(block.points.get("2", [])).reshape(-1, 2)
    corners = corners[shapely.distance(shapely.LinearRing(ring), shapely.points(corners)) < ENDS_MEET]
    return boundary_edges(ring, allowance, where, fold=fold, corners=corners if len(corners) > 1 else None)
