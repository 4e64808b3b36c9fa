"""Patterns read from SVG: the package's own, with the names of pieces, edges and seams, and drawings of other programs."""

from __future__ import annotations

import logging
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import FARTHEST, FloatArray, InputError, find_unused_name, quote_value, reading
from warpflat.pattern.drafting.curves import CHORD, as_cubic, cubic_weights
from warpflat.pattern.drafting.outline_edges import (
    named_outline,
    split_outline,
    with_drawn_allowances,
)
from warpflat.pattern.drafting.piece_parts import SAME_POINT, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.polygons import mapped, signed_area
from warpflat.pattern.drafting.seam_words import seams_of_words
from warpflat.pattern.export.outlines import (
    ENDS_MEET,
    MOST_POINTS,
    TOO_MANY,
    DrawnLine,
    boundary_pieces,
    by_size,
    counted,
    find_outlines,
    read_grain,
    read_quantity,
)

__all__ = ["read_svg"]

_MILLIMETRES = {"": 25.4 / 96, "px": 25.4 / 96, "mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
_LENGTH = re.compile(r"\s*([0-9.eE+-]*[0-9.])\s*([a-z]*)\s*")
_TRANSFORM = re.compile(r"(\w+)\s*\(([^)]*)\)")
# The chords of a curve are at most so many.
_MOST_CHORDS = 1000
_KINDS = {"sew": "seam", "hem": "hem", "fold": "fold", "dart": "dart"}
# What the package draws of a piece and does not read.
_NOT_READ = {
    "internal": "inner line",
    "left_out": "inner line",
    "notch": "notch",
    "cutout": "inner cut",
    "drill": "drill hole",
}
# Groups in each other and elements of a file, and letters of an entity, as drawing programs write for namespaces, at most.
_DEEPEST, _MOST_ELEMENTS, _LONGEST_ENTITY = 100, 200_000, 100
# How FreeSewing calls the group of a piece, and the classes of its outlines.
_STACK, _CLOTHS = "fs-stack-", {"fabric", "lining", "interfacing", "canvas", "contrast"}
_LABEL, _GROUPMODE = (f"{{http://www.inkscape.org/namespaces/inkscape}}{word}" for word in ("label", "groupmode"))
_HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
# What is drawn where it is used only, and what is drawn without a line.
_SIDES = "width", "height"
_DEFINED, _NO_LINES = ("defs", "symbol", "clipPath", "marker", "mask", "pattern"), ("image", "foreignObject")


def read_svg(path: str | os.PathLike[str], *, allowance: float | None = None) -> Pattern:
    """Read the pieces of a drawing in true size; the seams too, where the file names them as the package does.

    Of FreeSewing's drawings each stack is a piece of its name, by its sewing line, with its grain.

    In other files every closed line is a piece, called by its label or id, as :mod:`warpflat.pattern.export.outlines` says; all shapes are
    lines, and open ones may form an outline together. Sizes are those of `width`, `height` and `viewBox`; a file without units has
    96 units an inch.

    Args:
        path: of the file.
        allowance: from the cutting line to the sewing line [m], of other files; none if not given. FreeSewing's have a sewing line.

    Raises:
        InputError: the file cannot be read, has no piece, or an outline does not close.
    """
    path = Path(path)
    with reading(path, "SVG") as place:
        root = _parse(path)
        # The matrix from units of the drawing to metres, y upwards, and the sides of the page [m], if the file has them.
        pixel = _MILLIMETRES["px"]
        given = [_LENGTH.fullmatch(root.get(key, "")) for key in _SIDES]
        lengths = [
            float(found[1]) * _MILLIMETRES[found[2]] if found and found[2] in _MILLIMETRES else None for found in given
        ]
        box = root.get("viewBox", "").replace(",", " ").split()
        scale = [pixel, pixel]
        sides: tuple[float, float] | None = None
        if len(box) == 4:
            view = [float(word) for word in box[2:]]
            both = [side for side in lengths if side is not None]
            if lengths[0] is not None or lengths[1] is not None:
                if not all(0.0 < number < np.inf for number in (*both, *view)):
                    told = " and ".join(f"{key} {quote_value(root.get(key))}" for key in _SIDES if root.get(key))
                    raise InputError(f"{told} and viewBox {quote_value(' '.join(box))} must be numbers above 0")
                ratios = [side / wide for side, wide in zip(lengths, view, strict=True) if side is not None]
                stretched = root.get("preserveAspectRatio", "").strip() == "none" and len(ratios) == 2
                scale = ratios if stretched else [min(ratios)] * 2
            sides = 1e-3 * scale[0] * view[0], 1e-3 * scale[1] * view[1]
        elif lengths[0] is not None and lengths[1] is not None:
            sides = 1e-3 * lengths[0], 1e-3 * lengths[1]
        page = 1e-3 * np.array([[scale[0], 0.0, 0.0], [0.0, -scale[1], 0.0]])
        drawing = _Drawing(root)
        groups = [(element, matrix) for element, matrix in drawing.walk(page) if "data-piece" in element.attrib]
        pieces, words = list[Piece](), dict[str, list[tuple[str, str, str]]]()
        unread = list[str]()
        for group, matrix in groups:
            place.at = f"piece {quote_value(group.get('data-piece'))}"
            pieces.append(_own_piece(drawing, group, matrix, words, unread, str(path)))
        notes = list[str]()
        if not pieces:
            pieces, notes = _freesewing_pieces(drawing, page, str(path))
        if not pieces:
            # A drawing of another program.
            lines = list[DrawnLine]()
            for element, matrix in drawing.walk(page):
                place.at = f"{element.tag.rpartition('}')[2]} {quote_value(element.get('id', ''))}"
                lines += drawing.lines(element, matrix)
            place.at = ""
            rings, notes = find_outlines(lines, str(path), page=sides)
            pieces = boundary_pieces(rings, allowance, str(path), set())
        if not pieces:
            raise InputError(f"{path}: has no closed path; a piece is a closed path")
        if unread:
            notes.append(f"what belongs to pieces and is not read: {counted(unread)}")
        if drawing.unread and not groups:
            notes.append(f"what is no line, or is hidden, was left out: {counted(drawing.unread)}")
        sizes = by_size(pieces)
        return Pattern(
            name=path.stem, pieces=sizes, seams=seams_of_words(words.get(next(iter(sizes)), [])), notes=notes
        )


def _own_piece(
    drawing: _Drawing,
    group: ET.Element,
    matrix: FloatArray,
    words: dict[str, list[tuple[str, str, str]]],
    unread: list[str],
    path: str,
) -> Piece:
    """Return the piece of a group that the package wrote.

    Args:
        drawing: in which it lies.
        group: of the piece.
        matrix: 2 by 3, from the group to the page [m].
        words: what is sewn to its edges is added, by size.
        unread: kinds of what belongs to the piece but is not read are added.
        path: what messages begin with.

    Raises:
        InputError: the outline does not close.
    """
    name, size, grain = group.get("data-piece", ""), group.get("data-size", ""), None
    parts, legs, cutting = list[tuple[str, str, FloatArray]](), list[FloatArray](), list[FloatArray]()
    folds = dict[str, FloatArray]()
    for element in group:
        role, edge = element.get("class", ""), element.get("data-edge", "")
        if _tag(element) != "path" or not (edge or role in ("dart", "drill")):
            continue
        line = drawing.lines(element, _times(matrix, _transform(element.get("transform", ""))))[0]
        if role == "grain":
            grain = read_grain(line)
        elif role == "cut":
            cutting.append(line.path)
        elif role in _KINDS and edge:
            kind = "cut" if element.get("data-kind") == "cut" else _KINDS[role]
            parts.append((edge, kind, line.path))
            sewn = [text.strip() for text in element.get("data-seam", "").split("\n")]
            words.setdefault(size, []).extend((name, edge, text) for text in sewn if text)
        elif role in _KINDS:
            legs.append(line.points)
        elif role == "dart_fold":
            folds[edge.removesuffix(".fold")] = line.points[0]
        elif role in _NOT_READ and (edge or line.closed):
            unread.append(_NOT_READ[role])
    # A closed line is the sewing line of a hole, but where it goes around the whole piece.
    parts = [part for part in parts if (part[2][0] != part[2][-1]).any()] or parts[:1]
    # The sides of a fish-eye dart, one after the other, meet at both ends.
    eyes = list[Hole]()
    for one, other in pairwise(tuple(parts)):
        if one[1] == other[1] == "dart" and np.abs(one[2][[0, -1]] - other[2][[0, -1]]).max() < SAME_POINT:
            ring = np.concatenate([one[2][:-1], other[2][:0:-1]])
            ring = ring if signed_area(ring) > 0.0 else ring[::-1]
            eyes.append(Hole(name=one[0].removesuffix(".left"), points=ring, kind="dart"))
            parts = [part for part in parts if part is not one and part is not other]
    where = f"{path}: {name}"
    if not parts:
        raise InputError(f"{where}: has no sewing line; a group of a piece has paths with data-edge")
    ends = np.array([line[k] for _, kind, line in parts if kind == "dart" for k in (0, -1)]).reshape(-1, 2)
    close = cKDTree(ends).query(ends, k=2)[0][:, 1] < SAME_POINT if len(ends) else slice(0)
    ends, tips = ends[close], dict[str, FloatArray]()
    # The line on which a dart is folded has its name, and begins at its tip, that of a pleat as far from it as it is open.
    for dart in [name for name in folds if name not in {eye.name for eye in eyes}] if len(ends) else ():
        tips[dart] = ends[np.linalg.norm(ends - folds[dart], axis=1).argmin()]
    for end in ends:
        if not any(np.linalg.norm(end - tip) < SAME_POINT for tip in tips.values()):
            tips[find_unused_name("dart", tips)] = end
    edges, darts = named_outline(parts, tips, legs, cutting, where)
    quantity = read_quantity(group.get("data-quantity", "1"))
    return Piece(name=name, size=size, edges=edges, darts=darts, holes=eyes, grain=grain, quantity=quantity)


def _freesewing_pieces(drawing: _Drawing, page: FloatArray, where: str) -> tuple[list[Piece], list[str]]:
    """Return the pieces of a drawing of FreeSewing, and what was left out of it.

    Paths have the cloth as their class, "sa" along the seam allowance. Markers at the ends of others make them grain lines, or lines
    from whose ends on the fold the grain runs along it.
    """
    pieces, taken, notes = list[Piece](), set[str](), list[str]()
    for stack, matrix in drawing.walk(page):
        title = stack.get("id", "")
        if not title.startswith(_STACK) or "-part-" in title:
            continue
        sewing, cutting, grain, fold = list[DrawnLine](), list[FloatArray](), None, None
        for element, placed in drawing.walk_below(stack, matrix):
            kinds = element.get("class", "").split()
            marked = (_style(element, "marker-start") + _style(element, "marker-end")).lower()
            for line in drawing.lines(element, placed):
                if not _CLOTHS.isdisjoint(kinds) and "sa" not in kinds:
                    sewing.append(line)
                elif "sa" in kinds:
                    cutting.append(line.path)
                elif "cutonfold" in marked:
                    grain = fold = read_grain(line)
                elif "grainline" in marked:
                    grain = read_grain(line)
        if not sewing:
            continue
        # A stack is called after its design and its part, "aaron.front".
        own = title.removeprefix(_STACK).rpartition(".")[2] or "piece"
        rings, lost = find_outlines(sewing, f"{where}: {own}", fold=fold)
        notes += [f"{own}: {note}" for note in lost]
        for ring in rings:
            name = find_unused_name(own, taken)
            taken.add(name)
            edges = split_outline(ring.points, None, fold)
            pieces.append(
                Piece(name=name, edges=with_drawn_allowances(edges, cutting) if cutting else edges, grain=grain)
            )
    return pieces, notes


def _parse(path: Path) -> ET.Element:
    """Return the tree of an XML file. Entities that hold others, or that are other files, are refused.

    Raises:
        InputError: it has such, or is nested too deeply or has too many elements.
        ExpatError: it is no XML.
    """
    parser, builder = expat.ParserCreate(namespace_separator="}"), ET.TreeBuilder()
    count = depth = 0

    def entity(name: str, parameter: bool, value: str | None, *_: object) -> None:
        if value is None or parameter or "&" in value or len(value) > _LONGEST_ENTITY:
            raise InputError(f"declares the entity {quote_value(name)}, which is another file, long or made of others")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        if depth > _DEEPEST or count > _MOST_ELEMENTS:
            raise InputError(
                f"line {parser.CurrentLineNumber}: nested deeper than {_DEEPEST}, or more than {_MOST_ELEMENTS:,} elements; "
                "ungroup the drawing, and leave out all but the pattern"
            )
        builder.start(_qualified(tag), {_qualified(key): value for key, value in attributes.items()})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(_qualified(tag))

    parser.EntityDeclHandler, parser.StartElementHandler, parser.EndElementHandler = entity, start, end
    parser.Parse(path.read_bytes(), True)
    return builder.close()


def _qualified(name: str) -> str:
    """Return a name as ElementTree has it, its namespace in braces."""
    return "{" + name if "}" in name else name


class _Drawing:
    """The elements of a drawing at their places.

    Attributes:
        root: of the file.
        unread: kinds of what is drawn but no line, and of what is hidden, one for each that was met.
    """

    def __init__(self, root: ET.Element) -> None:
        self.root = root
        self.unread = list[str]()
        self._by_id = {element.get("id", ""): element for element in root.iter()}
        self._group: dict[int, str] = {}
        self._met = self._points = 0

    def walk(self, page: FloatArray) -> Iterator[tuple[ET.Element, FloatArray]]:
        """Yield all elements with their matrices to the page; what is only defined is left out, what is used is at its place."""
        self.unread, self._met, self._points = [], 0, 0
        yield from self._walk(self.root, page, "", 0)

    def walk_below(self, element: ET.Element, matrix: FloatArray) -> Iterator[tuple[ET.Element, FloatArray]]:
        """Yield all elements below another one whose matrix is known."""
        for child in element:
            yield from self._walk(child, matrix, "", 0)

    def _walk(
        self, element: ET.Element, matrix: FloatArray, group: str, depth: int
    ) -> Iterator[tuple[ET.Element, FloatArray]]:
        tag = _tag(element)
        self._met += 1
        if depth > _DEEPEST or self._met > _MOST_ELEMENTS:
            raise InputError(
                f"more than {_MOST_ELEMENTS:,} elements are drawn, or one holds itself; draw the pattern alone"
            )
        if tag in _DEFINED:
            return
        if _style(element, "display") == "none" or _style(element, "visibility") == "hidden":
            self.unread.append(f"hidden {tag}")
            return
        placed = _times(matrix, _transform(element.get("transform", "")))
        if tag == "svg" and depth:
            placed = _times(placed, _viewport(element))
        if tag in _NO_LINES:
            self.unread.append(tag)
        if tag in ("g", "a", "switch", "use") and element.get(_GROUPMODE) != "layer":
            group = _name(element) if _by_hand(element) else group
        self._group[id(element)] = group
        yield element, placed
        children = list(element)
        if tag == "use":
            used = self._by_id.get(
                next((element.get(key, "") for key in _HREFS if element.get(key)), "").removeprefix("#")
            )
            placed = _times(placed, np.array([[1.0, 0.0, _length(element, "x")], [0.0, 1.0, _length(element, "y")]]))
            children = [] if used is None else [used]
            if used is None:
                self.unread.append("use of what the file does not have")
            elif _tag(used) == "symbol":
                # A symbol is a drawing of its own, in the size in which it is used.
                sized = ET.Element(
                    "svg", {**used.attrib, **{key: element.attrib[key] for key in _SIDES if key in element.attrib}}
                )
                placed, children = _times(placed, _viewport(sized)), list(used)
        for child in children:
            yield from self._walk(child, placed, group, depth + 1)

    def lines(self, element: ET.Element, matrix: FloatArray) -> list[DrawnLine]:
        """Return the lines of a shape in metres.

        Raises:
            InputError: a coordinate is no number or far off, or the drawing has too many points.
        """
        from fontTools.pens.recordingPen import RecordingPen  # type: ignore[import-untyped]
        from fontTools.svgLib.path import parse_path  # type: ignore[import-untyped]

        text = _path_data(element)
        if not text.strip():
            return []
        # Curves lie within `CHORD` of their chords, by the length of the drawing's unit [m].
        scale = float(np.linalg.norm(matrix[:, :2], 2))
        logging.getLogger("fontTools").addHandler(logging.NullHandler())
        pen: Any = RecordingPen()
        parse_path(text, pen)
        parts: list[FloatArray] = []
        found, count = list[tuple[FloatArray, bool]](), 0
        for command, args in pen.value:
            control = [np.array(point, dtype=np.float64) for point in args]
            pieces = 1
            if command in ("curveTo", "qCurveTo"):
                curve = as_cubic(np.array([parts[-1][-1], *control]))
                bend = scale * float(np.linalg.norm(np.diff(curve, n=2, axis=0), axis=1).max())
                pieces = int(np.clip(np.ceil(np.sqrt(0.75 * bend / CHORD)), 1, _MOST_CHORDS)) if bend < FARTHEST else 1
            count += pieces
            if count > MOST_POINTS:
                raise InputError(TOO_MANY)
            if command == "moveTo":
                parts = [control[0][None]]
            elif command == "lineTo":
                parts.append(control[0][None])
            elif command in ("curveTo", "qCurveTo"):
                parts.append(cubic_weights(np.linspace(0.0, 1.0, pieces + 1)[1:]) @ curve)
            else:
                line = np.concatenate(parts)
                ends_meet = bool(np.linalg.norm(line[0] - line[-1]) < 1e-6)
                found.append((line, command == "closePath" or ends_meet))
        lines, alone = list[DrawnLine](), len(found) == 1
        for points, closed in found:
            points = points[np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9])]
            points = mapped(points, matrix)
            if not np.abs(points).max() < FARTHEST:
                raise InputError(
                    f"{_tag(element)} reaches farther than {FARTHEST:g} m, or has a coordinate that is no number"
                )
            if len(points) > 2 and np.linalg.norm(points[0] - points[-1]) < (1e-9 if closed else ENDS_MEET):
                points, closed = points[:-1], True
            self._points += len(points)
            if self._points > MOST_POINTS:
                raise InputError(TOO_MANY)
            if len(points) > 1:
                group = self._group.get(id(element), "")
                hand = alone and _by_hand(element)
                lines.append(DrawnLine(points=points, closed=closed, name=_name(element), group=group, by_hand=hand))
        return lines


def _tag(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]


def _name(element: ET.Element) -> str:
    return element.get(_LABEL) or element.get("id") or ""


def _by_hand(element: ET.Element) -> bool:
    """Return whether a person has named an element: an id of its kind, or of its program, and a number is no name."""
    own = element.get("id", "")
    automatic = re.fullmatch(rf"(?:{_tag(element)}|path|g|svg|use|shape|object)[-_]?[0-9][-_.0-9]*", own, re.IGNORECASE)
    return bool(element.get(_LABEL)) or bool(own and not automatic)


def _style(element: ET.Element, key: str) -> str:
    """Return a property of an element, which stands in its style or in an attribute."""
    found = re.search(rf"(?:^|;)\s*{key}\s*:\s*([^;]*)", element.get("style", ""))
    return (found[1] if found else element.get(key, "")).strip()


def _length(element: ET.Element, key: str, otherwise: str = "0") -> float:
    """Return a length of an element in units of the drawing."""
    text = element.get(key) or otherwise
    found = _LENGTH.fullmatch(text)
    if found is None or found[2] not in _MILLIMETRES:
        raise InputError(f"{key} is {quote_value(text)}; it must be a length, such as 10 or 10mm")
    return float(found[1]) * (_MILLIMETRES[found[2]] / _MILLIMETRES["px"] if found[2] else 1.0)


def _viewport(element: ET.Element) -> FloatArray:
    """Return the matrix of a drawing within another one: its place, and its units; where it would be centred, its corner stays."""
    box = [float(word) for word in element.get("viewBox", "").replace(",", " ").split()]
    scale, corner = np.ones(2), np.zeros(2)
    if len(box) == 4 and min(box[2:]) > 0.0:
        sides = [_length(element, key, str(wide)) for key, wide in zip(_SIDES, box[2:], strict=True)]
        scale, corner = np.array(sides) / box[2:], np.array(box[:2])
        if element.get("preserveAspectRatio", "").strip() != "none":
            scale[:] = scale.min()
    place = np.array([_length(element, "x"), _length(element, "y")])
    return np.column_stack([np.diag(scale), place - scale * corner])


def _transform(text: str) -> FloatArray:
    """Return the matrix of a `transform`; the first of its functions is applied last."""
    from fontTools.misc.transform import Transform  # type: ignore[import-untyped]

    found = Transform()
    for name, values in _TRANSFORM.findall(text):
        v = [float(word) for word in values.replace(",", " ").split()]
        if name == "matrix":
            found = found.transform(tuple(v[:6]))
        elif name in ("translate", "scale"):
            found = getattr(found, name)(v[0], *v[1:2])
        elif name == "rotate":
            x, y = v[1:3] if len(v) == 3 else (0.0, 0.0)
            found = found.translate(x, y).rotate(np.radians(v[0])).translate(-x, -y)
        elif name in ("skewX", "skewY"):
            found = found.skew(**{name[-1].lower(): np.radians(v[0])})
        else:
            raise ValueError(f"transform {name}")
    return np.array(found, dtype=np.float64).reshape(3, 2).T


def _times(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.column_stack([a[:, :2] @ b[:, :2], a[:, :2] @ b[:, 2] + a[:, 2]])


def _path_data(element: ET.Element) -> str:
    """Return the path data of a shape; "" of what is none."""
    tag, get = _tag(element), element.get
    if tag == "path":
        return get("d", "")
    if tag in ("polygon", "polyline"):
        values = get("points", "").replace(",", " ").split()
        text = " L".join(f"{x},{y}" for x, y in zip(values[::2], values[1::2], strict=True))
        return f"M{text}" + (" Z" if tag == "polygon" else "") if text else ""
    if tag == "line":
        a, b, c, d = (_length(element, key) for key in ("x1", "y1", "x2", "y2"))
        return f"M{a!r},{b!r} L{c!r},{d!r}"
    if tag in ("circle", "ellipse"):
        x, y = _length(element, "cx"), _length(element, "cy")
        rx, ry = (_length(element, key, get("r", "0")) for key in ("rx", "ry"))
        turn = f"A{rx!r},{ry!r} 0 0 1"
        return f"M{x - rx!r},{y!r} {turn} {x + rx!r},{y!r} {turn} {x - rx!r},{y!r} Z" if rx > 0.0 < ry else ""
    if tag == "rect":
        x, y, w, h = (_length(element, key) for key in ("x", "y", "width", "height"))
        # Of a rounded corner one radius may stand for both.
        rx, ry = (_length(element, key, get(other, "0")) for key, other in (("rx", "ry"), ("ry", "rx")))
        rx, ry = min(max(rx, 0.0), w / 2), min(max(ry, 0.0), h / 2)
        if not (w > 0.0 < h):
            return ""
        if not rx > 0.0 < ry:
            return f"M{x!r},{y!r} h{w!r} v{h!r} h{-w!r} Z"
        sides = (f"h{w - 2 * rx!r}", f"v{h - 2 * ry!r}", f"h{2 * rx - w!r}", f"v{2 * ry - h!r}")
        turns = ((rx, ry), (-rx, ry), (-rx, -ry), (rx, -ry))
        around = (f"{side} a{rx!r},{ry!r} 0 0 1 {a!r},{b!r}" for side, (a, b) in zip(sides, turns, strict=True))
        return f"M{x + rx!r},{y!r} {' '.join(around)} Z"
    return ""
