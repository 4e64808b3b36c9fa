"""Patterns read from SVG: the package's own, with the names of pieces, edges and seams, and drawings of other programs."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.input_files import note_read
from warpflat.export.read_dxf import check_closed, outermost
from warpflat.pattern.outline_edges import chain_edges, find_darts, inset, split_outline
from warpflat.pattern.pieces import Garment, Piece
from warpflat.pattern.seam_words import seams_of_words

__all__ = ["read_svg"]

_MILLIMETRES = {"": 25.4 / 96, "px": 25.4 / 96, "mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
_LENGTH = re.compile(r"\s*([0-9.eE+-]+)\s*([a-z]*)\s*")
_TRANSFORM = re.compile(r"(\w+)\s*\(([^)]*)\)")
_SAMPLES = np.linspace(0.0, 1.0, 25)[1:]
_KINDS = {"sew": "seam", "hem": "hem", "fold": "fold", "dart": "dart"}
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def read_svg(path: str | os.PathLike[str], *, allowance: float | None = None) -> Garment:
    """Read the pieces of a drawing in true size; the seams too, where the file names them as the package does.

    In other files every closed path that lies in no other is a piece, called by its label or id. Its size is that of `width` and
    `viewBox`; a file without units has 96 units an inch.

    Args:
        path: of the file.
        allowance: from the cutting line to the sewing line [m], of other files; none if not given.

    Raises:
        InputError: the file cannot be read, has no piece, or an outline does not close.
    """
    path = Path(path)
    note_read(path)
    try:
        root = ET.parse(path).getroot()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ET.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: cannot be read as SVG ({str(error)[:80]})") from None
    page = _page_matrix(root)
    try:
        groups = [(element, matrix) for element, matrix in _walk(root, page) if "data-piece" in element.attrib]
        pieces, words = list[Piece](), dict[str, list[tuple[str, str, str]]]()
        for group, matrix in groups:
            pieces.append(_own_piece(group, matrix, words, str(path)))
        if not pieces:
            pieces = _other_pieces(root, page, allowance or 0.0, str(path))
    except (ValueError, IndexError, KeyError, AssertionError, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: has a path that cannot be read ({str(error)[:80]})") from None
    if not pieces:
        raise InputError(f"{path}: has no closed path; a piece is a closed path")
    sizes: dict[str, list[Piece]] = {}
    for piece in pieces:
        sizes.setdefault(piece.size, []).append(piece)
    return Garment(name=path.stem, pieces=sizes, seams=seams_of_words(words.get(next(iter(sizes)), [])))


def _page_matrix(root: ET.Element) -> FloatArray:
    """Return the 2 by 3 matrix from the units of the drawing to metres, y upwards."""
    scale = _MILLIMETRES["px"]
    width, box = _LENGTH.fullmatch(root.get("width", "")), root.get("viewBox", "").replace(",", " ").split()
    if width and width[2] in _MILLIMETRES:
        wide = float(width[1]) * _MILLIMETRES[width[2]]
        scale = wide / float(box[2]) if len(box) == 4 and float(box[2]) > 0.0 else _MILLIMETRES[width[2]]
    return np.array([[scale, 0.0, 0.0], [0.0, -scale, 0.0]]) * 1e-3


def _walk(element: ET.Element, matrix: FloatArray) -> Iterator[tuple[ET.Element, FloatArray]]:
    """Yield an element and all below it with their matrices to the page; what is only defined is left out."""
    if element.tag.rpartition("}")[2] in ("defs", "symbol", "clipPath", "marker", "pattern"):
        return
    own = _times(matrix, _transform(element.get("transform", "")))
    yield element, own
    for child in element:
        yield from _walk(child, own)


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


def _own_piece(group: ET.Element, matrix: FloatArray, words: dict[str, list[tuple[str, str, str]]], file: str) -> Piece:
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
    where = f"{file}: {name}"
    if not parts:
        raise InputError(f"{where}: has no sewing line; a group of a piece has paths with data-edge")
    edges = chain_edges(parts, where)
    ends = np.array([points[k] for points in legs for k in (0, -1)]).reshape(-1, 2)
    close = [sum(bool(np.linalg.norm(end - other) < 1e-6) for other in ends) for end in ends]
    tips = {f"dart_{n}": end for n, end in enumerate(ends) if close[n] > 1}
    darts = find_darts(edges, tips, where)
    quantity = group.get("data-quantity", "1")
    return Piece(
        name=name, size=size, edges=edges, darts=darts, grain=None if grain is None else grain[[0, -1]],
        quantity=int(quantity) if quantity.isdigit() else 1,
    )  # fmt: skip


def _other_pieces(root: ET.Element, page: FloatArray, allowance: float, file: str) -> list[Piece]:
    found: dict[int, tuple[FloatArray, str]] = {}
    unclosed = list[FloatArray]()
    for element, matrix in _walk(root, page):
        for points, closed in _lines(element, matrix):
            if closed:
                found[id(points)] = points, element.get(_LABEL) or element.get("id") or ""
            else:
                unclosed.append(points)
    check_closed(unclosed, [points for points, _ in found.values()], 1.0, file)
    pieces, taken = [], set[str]()
    for number, ring in enumerate(outermost([points for points, _ in found.values()]), start=1):
        name = found[id(ring)][1] or f"piece_{number}"
        name = name if name not in taken else f"{name}_{number}"
        taken.add(name)
        pieces.append(Piece(name=name, edges=split_outline(inset(ring, allowance, f"{file}: {name}"))))
    return pieces


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
            yield points @ matrix[:, :2].T + matrix[:, 2], closed


def _flatten(text: str) -> Iterator[tuple[FloatArray, bool]]:
    """Yield the lines of path data."""
    from fontTools.pens.recordingPen import RecordingPen  # type: ignore[import-untyped]
    from fontTools.svgLib.path import parse_path  # type: ignore[import-untyped]

    pen: Any = RecordingPen()
    parse_path(text, pen)
    points: list[FloatArray] = []
    for command, args in pen.value:
        control = [np.array(point, dtype=np.float64) for point in args]
        if command == "moveTo":
            points = [control[0][None]]
        elif command == "lineTo":
            points.append(control[0][None])
        elif command in ("curveTo", "qCurveTo"):
            points.append(_bezier(np.array([points[-1][-1], *control])))
        else:
            line = np.concatenate(points)
            ends_meet = bool(np.linalg.norm(line[0] - line[-1]) < 1e-6)
            yield line, command == "closePath" or ends_meet


def _bezier(control: FloatArray) -> FloatArray:
    """Return points of a Bézier curve (#C by 2) but its first, by de Casteljau's algorithm."""
    rows = np.repeat(control[None], len(_SAMPLES), axis=0)
    while rows.shape[1] > 1:
        rows = (1.0 - _SAMPLES)[:, None, None] * rows[:, :-1] + _SAMPLES[:, None, None] * rows[:, 1:]
    return np.asarray(rows[:, 0])
