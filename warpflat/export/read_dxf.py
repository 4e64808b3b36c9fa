"""Patterns read from DXF of apparel CAD: the package's own, with the names of edges and seams, and other programs'."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.input_files import FARTHEST, Place, reading
from warpflat.core.text import quote_value
from warpflat.pattern.outline_edges import chain_edges, find_darts, inset, split_outline
from warpflat.pattern.pieces import Pattern, Piece
from warpflat.pattern.seam_words import seams_of_words

__all__ = ["MOST_POINTS", "check_closed", "outermost", "read_dxf", "read_quantity"]

# Curves are flattened to within this [m].
_FLAT = 2e-5
#: Points of a drawing, at most: a pattern of several sizes has some ten thousand.
MOST_POINTS = 1_000_000
_METRES = {"METRIC": 1e-3, "ENGLISH": 0.0254}
# The header's $INSUNITS, where no text names the units: inches, feet, millimetres, centimetres, metres.
_METRES_OF_HEADER = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0}
# Ends of lines that are nearer to each other than this share of the drawing meet.
_MEET = 1e-5
# A line whose ends lack less than this share of its length to meet, a side at most, is an outline that does not close, if it goes
# around this share of the largest piece.
_NEARLY_CLOSED, _LEAST_SHARE = 0.4, 0.1


@dataclass
class _Block:
    """What a block holds: lines by layer, points by layer, texts by layer in their order."""

    lines: dict[str, list[tuple[FloatArray, bool]]] = field(default_factory=dict)
    points: dict[str, list[FloatArray]] = field(default_factory=dict)
    texts: list[tuple[str, str, FloatArray]] = field(default_factory=list)
    count: int = 0
    _loops: dict[str, list[FloatArray]] = field(default_factory=dict)

    def closed(self, layer: str) -> list[FloatArray]:
        return [points for points, closed in self.lines.get(layer, []) if closed]

    def loops(self, layer: str) -> list[FloatArray]:
        """Return the closed lines of a layer, and those that its open lines form together (#P by 2 each)."""
        if layer not in self._loops:
            self._loops[layer] = [*self.closed(layer), *_joined(self.open(layer))]
        return self._loops[layer]

    def open(self, layer: str) -> list[FloatArray]:
        return [points for points, closed in self.lines.get(layer, []) if not closed]

    def all_loops(self) -> list[FloatArray]:
        """Return the closed lines of all layers; boundary and sewing line hide what lies inside."""
        return [points for layer in self.lines for points in self.loops(layer)]

    def value(self, key: str) -> str:
        """Return what stands behind a key such as "PIECE NAME", in whichever case."""
        found = (text.partition(":") for _, text, _ in self.texts)
        return next((value.strip() for name, _, value in found if name.strip().upper() == key), "")


def read_dxf(path: str | os.PathLike[str], *, allowance: float | None = None) -> Pattern:
    """Read the pieces of a pattern; the seams too, where the file names them as the package does.

    A block is a piece. Its sewing line is on layer 14, its boundary on layer 1, its grain on layer 7. In a file without such
    layers the outermost closed line of a block is its boundary; without blocks every closed line of the drawing is a piece. A line
    may be made of several lines, arcs and splines. Units are those of the text UNITS, of the header, or else millimetres.

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
        found = {name: _texts(entities, place) for name, entities in layouts}
        units = next((text for text in (each.value("UNITS") for each in found.values()) if text), "")
        metres = _METRES.get(units.upper(), _METRES_OF_HEADER.get(document.header.get("$INSUNITS", 0), 1e-3))
        for name, entities in layouts:
            _add_lines(found[name], entities, metres, MOST_POINTS - sum(each.count for each in found.values()), place)
        place.at = ""
        style, blocks = found[""], [(name, found[name]) for name, _ in layouts[1:]]
        pieces, words = list[Piece](), dict[tuple[str, str], list[tuple[str, str, str]]]()
        # Other programs draw on layers of their own; a block that is not in the drawing, such as an arrow, is no piece then.
        inserted = {entity.dxf.name for entity in space if entity.dxftype() == "INSERT"}
        named = [row for row in blocks if row[1].loops("1") or row[1].closed("14")]
        for name, block in named or [row for row in blocks if row[0] in inserted and row[1].all_loops()]:
            pieces.append(_piece(name, block, metres, allowance, words, f"{path}: {name}"))
        if not pieces:
            pieces = [
                Piece(
                    name=f"piece_{n}", edges=split_outline(inset(ring * metres, allowance or 0.0, f"{path}: piece_{n}"))
                )
                for n, ring in enumerate(outermost(style.all_loops()), start=1)
            ]
        if not named:
            for each in [style, *(block for name, block in blocks if name in inserted)]:
                check_closed(
                    [line for layer in each.lines for line in each.open(layer)], each.all_loops(), metres, str(path)
                )
        if not pieces:
            raise InputError(f"{path}: has no closed line; a piece is a closed line on layer 1 of a block")
        sizes: dict[str, list[Piece]] = {}
        for piece in pieces:
            sizes.setdefault(piece.size, []).append(piece)
        first = next(iter(sizes))
        seams = seams_of_words(entry for (size, _), rows in words.items() if size == first for entry in rows)
        sample = style.value("SAMPLE SIZE")
        return Pattern(
            name=style.value("STYLE NAME") or path.stem, pieces=sizes, seams=seams,
            sample_size=sample if sample in sizes else None,
        )  # fmt: skip


def outermost(loops: Iterable[FloatArray]) -> list[FloatArray]:
    """Return the closed lines (#P by 2) that lie in no other, the largest first."""
    import shapely

    rings = [(ring, shapely.Polygon(ring)) for ring in loops if len(ring) > 2]
    rings = sorted((pair for pair in rings if pair[1].area > 0.0), key=lambda pair: -pair[1].area)
    polygons = np.array([polygon for _, polygon in rings])
    shapely.prepare(polygons)
    tree, found = shapely.STRtree(polygons), np.zeros(len(rings), dtype=bool)
    for number, polygon in enumerate(polygons):
        inside = polygon.representative_point()
        around = tree.query(inside)
        found[number] = not shapely.contains(polygons[around[found[around]]], inside).any()
    return [rings[number][0] for number in np.flatnonzero(found)]


def read_quantity(text: str) -> int:
    """Return how often a piece is cut, as a file has it; 1 where it is no number from 1 to 999."""
    return int(text) if re.fullmatch(r"\s*0*[1-9][0-9]{0,2}\s*", text) else 1


def check_closed(lines: Sequence[FloatArray], loops: Iterable[FloatArray], metres: float, where: str) -> None:
    """Refuse open lines (#P by 2) that nearly go around a piece, beside the closed ones: the piece would be lost.

    Raises:
        InputError: there are some.
    """
    import shapely

    closed = np.array([shapely.Polygon(ring) for ring in loops if len(ring) > 2])
    pieces, least = shapely.STRtree(closed), _LEAST_SHARE * max((each.area for each in closed), default=0.0)
    for chain in shapely.get_parts(
        shapely.line_merge(shapely.MultiLineString([line for line in lines if len(line) > 1]))
    ):
        points = np.array(chain.coords)
        gap, area = float(np.linalg.norm(points[-1] - points[0])), float(shapely.convex_hull(chain).area)
        round_something = len(points) > 2 and area > max(least, _LEAST_SHARE * (0.25 * chain.length) ** 2)
        if not round_something or gap >= _NEARLY_CLOSED * chain.length:
            continue
        # An outline may cross itself, so one point decides whether it lies within another.
        if not shapely.intersects(closed[pieces.query(chain.centroid)], chain.centroid).any():
            at = ", ".join(f"{1e3 * metres * x:.0f}" for x in points[0])
            raise InputError(
                f"{where}: an outline is open by {1e3 * metres * gap:.1f} mm at ({at}) mm; join its ends, for a piece is a closed line"
            )


def _joined(lines: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the closed lines that open lines form whose ends meet."""
    import shapely

    if not lines:
        return []
    ends = np.concatenate([line[[0, -1]] for line in lines])
    step = _MEET * max(float(np.ptp(ends, axis=0).max()), 1e-9)
    # Ends that meet get the same place: the first of them. Those in one cell of a fine grid are as one, as the middle of a star.
    _, sample, cell = np.unique(np.floor(ends / (0.25 * step)), axis=0, return_index=True, return_inverse=True)
    near = cKDTree(ends[sample]).query_ball_point(ends[sample], step)
    first = np.array([sample[each].min() for each in near])
    place = ends[first[cell.ravel()]].reshape(len(lines), 2, 2)
    strings = [
        shapely.LineString(np.concatenate([place[k, :1], line[1:-1], place[k, 1:]])) for k, line in enumerate(lines)
    ]
    rings = shapely.get_parts(shapely.polygonize(strings))
    return [np.array(ring.exterior.coords)[:-1] for ring in rings]


def _texts(entities: Iterable[Any], place: Place) -> _Block:
    """Return the texts and the points of a block."""
    found = _Block()
    for entity in entities:
        kind, layer = entity.dxftype(), str(entity.dxf.layer)
        if kind in ("TEXT", "MTEXT", "POINT"):
            place.at = f"{kind} on layer {quote_value(layer)}"
            at = np.array(tuple(entity.dxf.location if kind == "POINT" else entity.dxf.insert)[:2])
            if not np.isfinite(at).all():
                raise InputError("its place is no number")
            if kind == "POINT":
                found.points.setdefault(layer, []).append(at)
            else:
                text = entity.dxf.text if kind == "TEXT" else entity.plain_text()
                found.texts.append((layer, str(text).strip(), at))
    return found


def _add_lines(found: _Block, entities: Iterable[Any], metres: float, most: int, place: Place) -> None:
    """Add the lines of a block to it, curves flattened; what has no length is left out.

    Raises:
        InputError: a coordinate is no number or far off, or there are more than `most` points.
    """
    from ezdxf.path import make_path

    for entity in entities:
        kind, layer = entity.dxftype(), str(entity.dxf.layer)
        if kind not in ("POLYLINE", "LWPOLYLINE", "LINE", "ARC", "CIRCLE", "SPLINE", "ELLIPSE"):
            continue
        place.at = f"{kind} on layer {quote_value(layer)}"
        if kind == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline):
            raise InputError("is a surface, not a line; a pattern is drawn with lines in the plane")
        if kind == "SPLINE" and max(len(entity.control_points), len(entity.fit_points)) < 2:
            continue
        path = make_path(entity)
        corners = np.array([tuple(corner) for corner in path.control_vertices()]).reshape(-1, 3)
        if np.abs(corners * metres).max(initial=0.0) > FARTHEST or not np.isfinite(corners).all():
            raise InputError(f"reaches farther than {FARTHEST:g} m, or has a coordinate that is no number")
        # At once all points of a curve would take gigabytes.
        flat = islice(path.flattening(_FLAT / metres), most - found.count + 1)
        points = np.array([tuple(point)[:2] for point in flat]).reshape(-1, 2)
        points = points[np.linalg.norm(np.diff(points, axis=0, prepend=np.inf), axis=1) > 1e-9]
        found.count += len(points)
        if found.count > most:
            raise InputError(f"the drawing has more than {MOST_POINTS:,} points; leave out all but the pattern")
        if len(points) > 1:
            closed = bool(np.linalg.norm(points[0] - points[-1]) < 1e-6 * max(1.0, float(np.ptp(points))))
            found.lines.setdefault(layer, []).append((points[:-1] if closed else points, closed))


def _piece(
    block_name: str,
    block: _Block,
    metres: float,
    allowance: float | None,
    words: dict[tuple[str, str], list[tuple[str, str, str]]],
    where: str,
) -> Piece:
    """Return the piece of a block; add what is sewn to its edges to `words`, by size and piece."""
    name, size = block.value("PIECE NAME") or block_name, block.value("SIZE")
    quantity = read_quantity(block.value("QUANTITY").split(",")[0])
    # The lines beside which a name stands, with their kind, and what is sewn to them.
    lines = [
        (layer, points) for layer in ("14", "8", "6") for points, closed in block.lines.get(layer, []) if not closed
    ]
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
            parts.append((last, {"6": "fold", "8": "dart"}.get(layer, "seam"), points * metres))
        elif text.startswith("SEAM: ") and last:
            sewn.append((last, text.removeprefix("SEAM: ")))
    tips = {text.removeprefix("DART: "): at * metres for _, text, at in block.texts if text.startswith("DART: ")}
    # The legs of a dart that is cut away are on the layer of seams.
    for number, (edge, kind, points) in enumerate(parts):
        ends_at_tip = any(np.linalg.norm(points[end] - tip) < 1e-6 for tip in tips.values() for end in (0, -1))
        if kind == "seam" and ends_at_tip:
            parts[number] = edge, "dart", points
    darts = []
    if parts:
        edges = chain_edges(parts, where)
        darts = find_darts(edges, tips, where)
        words[size, name] = [(name, edge, text) for edge, text in sewn]
    else:
        edges = _edges_without_names(block, metres, allowance, where)
    grain = next((points[[0, -1]] * metres for points, _ in block.lines.get("7", []) if len(points) > 1), None)
    if grain is not None and grain[1, 1] < grain[0, 1]:
        grain = grain[::-1]
    return Piece(
        name=name, size=size, edges=edges, darts=darts, quantity=quantity,
        grain=grain, fabric=block.value("FABRIC"),
    )  # fmt: skip


def _edges_without_names(block: _Block, metres: float, allowance: float | None, where: str) -> list[Any]:
    """Return the edges of a piece whose file names none: of its sewing line, or of its boundary less the allowance."""
    sewing = block.lines.get("14", [])
    if block.closed("14"):
        return split_outline(max(block.closed("14"), key=len) * metres)
    if sewing:
        parts = [(f"edge_{n}", "seam", points * metres) for n, (points, _) in enumerate(sewing, start=1)]
        return chain_edges(parts, where)
    ring = (outermost(block.loops("1") or block.all_loops()) or [np.zeros((0, 2))])[0] * metres
    if not len(ring):
        raise InputError(f"{where}: its outline has no area; a boundary is a closed line on layer 1")
    corners = np.array(block.points.get("2", [])).reshape(-1, 2) * metres
    if allowance:
        return split_outline(inset(ring, allowance, where))
    return split_outline(ring, corners if len(corners) > 1 else None)
