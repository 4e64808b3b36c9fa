"""Patterns read from SVG: the package's own, with the names of pieces, edges and seams, and drawings of other programs."""

from __future__ import annotations

import logging
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.input_files import FARTHEST, reading
from warpflat.core.text import find_unused_name, quote_value
from warpflat.export.read_dxf import MOST_POINTS, check_closed, outermost, read_quantity
from warpflat.pattern.curves import as_cubic, cubic_weights
from warpflat.pattern.outline_edges import chain_edges, find_darts, inset, split_outline
from warpflat.pattern.pieces import Pattern, Piece
from warpflat.pattern.seam_words import seams_of_words

__all__ = ["read_svg"]

_MILLIMETRES = {"": 25.4 / 96, "px": 25.4 / 96, "mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
_LENGTH = re.compile(r"\s*([0-9.eE+-]*[0-9.])\s*([a-z]*)\s*")
_TRANSFORM = re.compile(r"(\w+)\s*\(([^)]*)\)")
_SAMPLES = cubic_weights(np.linspace(0.0, 1.0, 25)[1:])
_KINDS = {"sew": "seam", "hem": "hem", "fold": "fold", "dart": "dart"}
# Groups in each other and elements of a file, and letters of an entity, as drawing programs write for namespaces, at most.
_DEEPEST, _MOST_ELEMENTS, _LONGEST_ENTITY = 100, 200_000, 100
_TOO_MANY = f"the drawing has more than {MOST_POINTS:,} points; leave out all but the pattern"
# How FreeSewing calls the group of a piece, and the classes of its outlines.
_STACK, _CLOTHS = "fs-stack-", {"fabric", "lining", "interfacing", "canvas", "contrast"}
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def read_svg(path: str | os.PathLike[str], *, allowance: float | None = None) -> Pattern:
    """Read the pieces of a drawing in true size; the seams too, where the file names them as the package does.

    Of FreeSewing's drawings each stack is a piece of its name, by its sewing line, with its grain.

    In other files every closed path that lies in no other is a piece, called by its label or id. Its size is that of `width` and
    `viewBox`; a file without units has 96 units an inch.

    Args:
        path: of the file.
        allowance: from the cutting line to the sewing line [m], of other files; none if not given. FreeSewing's have a sewing line.

    Raises:
        InputError: the file cannot be read, has no piece, or an outline does not close.
    """
    path = Path(path)
    with reading(path, "SVG") as place:
        root = _parse(path)
        # From the units of the drawing to metres, y upwards.
        scale = _MILLIMETRES["px"]
        width, box = _LENGTH.fullmatch(root.get("width", "")), root.get("viewBox", "").replace(",", " ").split()
        if width and width[2] in _MILLIMETRES:
            scale = _MILLIMETRES[width[2]]
            if len(box) == 4:
                wide, view = float(width[1]) * scale, float(box[2])
                if not (0.0 < wide < np.inf and 0.0 < view < np.inf):
                    raise InputError(
                        f"width {quote_value(width[0])} and viewBox {quote_value(' '.join(box))} must be numbers above 0"
                    )
                scale = wide / view
        page = np.array([[scale, 0.0, 0.0], [0.0, -scale, 0.0]]) * 1e-3
        groups = [(element, matrix) for element, matrix in _walk(root, page) if "data-piece" in element.attrib]
        pieces, words = list[Piece](), dict[str, list[tuple[str, str, str]]]()
        for group, matrix in groups:
            place.at = f"piece {quote_value(group.get('data-piece'))}"
            name, size = group.get("data-piece", ""), group.get("data-size", "")
            parts, grain, legs = list[tuple[str, str, FloatArray]](), None, list[FloatArray]()
            for element in group:
                role, edge = element.get("class", ""), element.get("data-edge", "")
                if element.tag.rpartition("}")[2] != "path" or not edge:
                    continue
                lines = list(_lines(element, _times(matrix, _transform(element.get("transform", "")))))
                if role == "grain":
                    grain = lines[0][0]
                elif role in _KINDS and not lines[0][1]:
                    parts.append((edge, _KINDS[role], lines[0][0]))
                    for text in element.get("data-seam", "").split("\n"):
                        if text.strip():
                            words.setdefault(size, []).append((name, edge, text.strip()))
                    if role == "dart":
                        legs.append(lines[0][0])
            where = f"{path}: {name}"
            if not parts:
                raise InputError(f"{where}: has no sewing line; a group of a piece has paths with data-edge")
            edges = chain_edges(parts, where)
            ends = np.array([points[k] for points in legs for k in (0, -1)]).reshape(-1, 2)
            close = cKDTree(ends).query(ends, k=2)[0][:, 1] < 1e-6 if len(ends) else []
            tips = {f"dart_{n}": end for n, end in enumerate(ends) if close[n]}
            darts = find_darts(edges, tips, where)
            pieces.append(
                Piece(
                    name=name,
                    size=size,
                    edges=edges,
                    darts=darts,
                    grain=None if grain is None else grain[[0, -1]],
                    quantity=read_quantity(group.get("data-quantity", "1")),
                )
            )
        if not pieces:
            pieces = _freesewing_pieces(root, page, str(path))
        if not pieces:
            # A drawing of another program: every closed path that lies in no other one is a piece.
            found: dict[int, tuple[FloatArray, str]] = {}
            unclosed = list[FloatArray]()
            total = 0
            for element, matrix in _walk(root, page):
                place.at = f"{element.tag.rpartition('}')[2]} {quote_value(element.get('id', ''))}"
                for points, closed in _lines(element, matrix):
                    total += len(points)
                    if total > MOST_POINTS:
                        raise InputError(_TOO_MANY)
                    if closed:
                        found[id(points)] = points, element.get(_LABEL) or element.get("id") or ""
                    else:
                        unclosed.append(points)
            place.at = ""
            check_closed(unclosed, [points for points, _ in found.values()], 1.0, str(path))
            taken = set[str]()
            for number, ring in enumerate(outermost([points for points, _ in found.values()]), start=1):
                name = found[id(ring)][1] or f"piece_{number}"
                name = name if name not in taken else f"{name}_{number}"
                taken.add(name)
                pieces.append(Piece(name=name, edges=split_outline(inset(ring, allowance or 0.0, f"{path}: {name}"))))
        if not pieces:
            raise InputError(f"{path}: has no closed path; a piece is a closed path")
        sizes: dict[str, list[Piece]] = {}
        for piece in pieces:
            sizes.setdefault(piece.size, []).append(piece)
        return Pattern(name=path.stem, pieces=sizes, seams=seams_of_words(words.get(next(iter(sizes)), [])))


def _freesewing_pieces(root: ET.Element, page: FloatArray, where: str) -> list[Piece]:
    """Return the pieces of a drawing of FreeSewing, whose paths have the cloth as their class, "sa" along the seam allowance."""
    pieces, taken = list[Piece](), set[str]()
    for stack, matrix in _walk(root, page):
        title = stack.get("id", "")
        if not title.startswith(_STACK) or "-part-" in title:
            continue
        rings, unclosed, grain = list[FloatArray](), list[FloatArray](), None
        for child in stack:
            for element, placed in _walk(child, matrix):
                kinds = element.get("class", "").split()
                for points, closed in _lines(element, placed):
                    if "sa" not in kinds and not _CLOTHS.isdisjoint(kinds):
                        (rings if closed else unclosed).append(points)
                    elif "grainline" in element.get("marker-start", "") + element.get("marker-end", ""):
                        grain = points[[0, -1]]
        check_closed(unclosed, rings, 1.0, where)
        # A stack is called after its design and its part, "aaron.front".
        own = title.removeprefix(_STACK).rpartition(".")[2] or "piece"
        for ring in outermost(rings) if rings else []:
            name = find_unused_name(own, taken)
            taken.add(name)
            pieces.append(Piece(name=name, edges=split_outline(ring), grain=grain))
    return pieces


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


def _walk(element: ET.Element, matrix: FloatArray) -> Iterator[tuple[ET.Element, FloatArray]]:
    """Yield an element and all below it with their matrices to the page; what is only defined is left out."""
    if element.tag.rpartition("}")[2] in ("defs", "symbol", "clipPath", "marker", "pattern"):
        return
    placed = _times(matrix, _transform(element.get("transform", "")))
    yield element, placed
    for child in element:
        yield from _walk(child, placed)


def _transform(text: str) -> FloatArray:
    found = np.eye(2, 3)
    for name, values in _TRANSFORM.findall(text):
        v = [float(word) for word in values.replace(",", " ").split()]
        if name == "matrix":
            one = np.array([[v[0], v[2], v[4]], [v[1], v[3], v[5]]])
        elif name == "translate":
            one = np.array([[1.0, 0.0, v[0]], [0.0, 1.0, v[1] if len(v) > 1 else 0.0]])
        elif name == "scale":
            one = np.array([[v[0], 0.0, 0.0], [0.0, v[-1], 0.0]])
        elif name == "rotate":
            c, s = np.cos(np.radians(v[0])), np.sin(np.radians(v[0]))
            x, y = v[1:3] if len(v) == 3 else (0.0, 0.0)
            one = np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y]])
        else:
            raise ValueError(f"transform {name}")
        found = _times(found, one)
    return found


def _times(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.column_stack([a[:, :2] @ b[:, :2], a[:, :2] @ b[:, 2] + a[:, 2]])


def _lines(element: ET.Element, matrix: FloatArray) -> Iterator[tuple[FloatArray, bool]]:
    """Yield the lines of a shape: points (#P by 2 [m]), and whether they close."""
    tag, get = element.tag.rpartition("}")[2], element.get
    if tag == "path":
        text = get("d", "")
    elif tag in ("polygon", "polyline"):
        values = get("points", "").replace(",", " ").split()
        text = "M" + " L".join(f"{x},{y}" for x, y in zip(values[::2], values[1::2], strict=True))
        text += " Z" if tag == "polygon" else ""
    elif tag == "rect":
        x, y, w, h = (float(get(key, "0")) for key in ("x", "y", "width", "height"))
        text = f"M{x},{y} h{w} v{h} h{-w} Z"
    else:
        return
    if not text.strip():
        return
    for points, closed in _flatten(text):
        kept = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9])
        points = points[kept]
        if closed and np.linalg.norm(points[0] - points[-1]) < 1e-9:
            points = points[:-1]
        if len(points) > 1:
            placed = points @ matrix[:, :2].T + matrix[:, 2]
            if not np.abs(placed).max() < FARTHEST:
                raise InputError(f"{tag} reaches farther than {FARTHEST:g} m, or has a coordinate that is no number")
            yield placed, closed


def _flatten(text: str) -> Iterator[tuple[FloatArray, bool]]:
    """Yield the lines of path data."""
    from fontTools.pens.recordingPen import RecordingPen  # type: ignore[import-untyped]
    from fontTools.svgLib.path import parse_path  # type: ignore[import-untyped]

    logging.getLogger("fontTools").addHandler(logging.NullHandler())
    pen: Any = RecordingPen()
    parse_path(text, pen)
    points: list[FloatArray] = []
    count = 0
    for command, args in pen.value:
        count += len(_SAMPLES) if command in ("curveTo", "qCurveTo") else 1
        if count > MOST_POINTS:
            raise InputError(_TOO_MANY)
        control = [np.array(point, dtype=np.float64) for point in args]
        if command == "moveTo":
            points = [control[0][None]]
        elif command == "lineTo":
            points.append(control[0][None])
        elif command in ("curveTo", "qCurveTo"):
            points.append(_SAMPLES @ as_cubic(np.array([points[-1][-1], *control])))
        else:
            line = np.concatenate(points)
            ends_meet = bool(np.linalg.norm(line[0] - line[-1]) < 1e-6)
            yield line, command == "closePath" or ends_meet
