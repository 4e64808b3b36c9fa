"""Flat pieces are meshed: outlines with the same points on both sides of every seam, a triangular lattice inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import Delaunay, cKDTree

from warpflat.core import FloatArray, InputError, IntArray, points_at_lengths, polyline_length, unit
from warpflat.flat import Fabric
from warpflat.garment.draping.sewn_cloth import ClothPiece, SewnCloth, join_pieces, piece_slices
from warpflat.garment.draping.worn_layer import closures
from warpflat.pattern import Edge, Piece, Seam, eased_length, hole_edges

__all__ = ["FlatMesh", "MeshedPieces", "Weld", "mesh_pieces", "sew_meshes"]

# Ends of edges on both sides of a seam that are closer than this share of the spacing are sewn to each other.
_SNAP = 0.35
# The lattice keeps this share of the spacing off the outline.
_OFF_OUTLINE = 0.6
_ROUNDS = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatMesh:
    """A piece as triangles.

    Attributes:
        points: #P by 2 [m].
        triangles: #T by 3, counter-clockwise.
        edges: by name the vertices of the edges of outline and holes, in their own direction.
        lines: by name the vertices nearest to internal lines.
    """

    points: FloatArray
    triangles: IntArray
    edges: Mapping[str, IntArray]
    lines: Mapping[str, IntArray]


#: Vertices that become one: piece and vertex of each.
Weld = list[tuple[str, int]]


class MeshedPieces(NamedTuple):
    """Pieces and their meshes by name, and for each seam the vertices that it joins, from its start on; buttons are one more at the end."""

    pieces: Mapping[str, Piece]
    meshes: Mapping[str, FlatMesh]
    welds: Sequence[Sequence[Weld]]


def mesh_pieces(pieces: Mapping[str, Piece], seams: Sequence[Seam], spacing: float) -> MeshedPieces:
    """Mesh pieces so that the vertices of their seams meet, and those where buttons and ties close them.

    Each seam is divided once, at the ends of the edges on both its sides and in between, and both sides get these points.
    The triangles are Delaunay's. A segment of the outline that is not among their edges is divided again, with its seam.

    Args:
        pieces: whole ones.
        seams: between them; each edge in one at most.
        spacing: wished edge [m].

    Raises:
        InputError: an edge is in two seams, or a piece is too narrow for the spacing.
    """
    buttons = closures(pieces)
    loops = {name: [list(piece.edges), *map(hole_edges, piece.holes)] for name, piece in pieces.items()}
    edges = {(name, edge.name): edge for name, rings in loops.items() for ring in rings for edge in ring}
    fixed = {
        name: np.array([point for layers in buttons for its, point in layers if its == name]).reshape(-1, 2)
        for name in pieces
    }
    owner: dict[tuple[str, str], int] = {}
    for number, seam in enumerate(seams):
        for side in seam.stretches:
            key = side.piece, side.edge
            if key in owner:
                raise InputError(f"edge {side} is sewn twice, in {seams[owner[key]].name!r} and {seam.name!r}")
            owner[key] = number
    finer: dict[object, int] = {}
    for _ in range(_ROUNDS):
        stations = {
            key: np.linspace(0.0, edge.length, _parts(edge.length, spacing, finer.get(key, 1)) + 1)
            for key, edge in edges.items()
            if key not in owner
        }
        joints = [_divide(seam, edges, spacing, finer.get(k, 1), stations) for k, seam in enumerate(seams)]
        meshes, missing = {}, set()
        for name, piece in pieces.items():
            along = {edge.name: stations[name, edge.name] for ring in loops[name] for edge in ring}
            meshes[name], lost = _mesh(piece, loops[name], along, spacing, fixed[name])
            missing |= {owner.get((name, edge), (name, edge)) for edge in lost}
        if not missing:
            welds = [[[(p, int(meshes[p].edges[e][k])) for p, e, k in joint] for joint in row] for row in joints]
            closed = [[(p, int(cKDTree(meshes[p].points).query(at)[1])) for p, at in layers] for layers in buttons]
            return MeshedPieces(pieces, meshes, [*welds, closed] if closed else welds)
        for group in missing:
            finer[group] = 2 * finer.get(group, 1)
    narrow = next(iter(missing))
    where = seams[narrow].name if isinstance(narrow, int) else ".".join(narrow)
    raise InputError(
        f"the cloth beside {where!r} is too narrow for a mesh of {1e3 * spacing:g} mm; give a smaller spacing"
    )


def sew_meshes(
    meshed: MeshedPieces,
    fabric: Fabric,
    placed: Mapping[str, FloatArray] | None = None,
    *,
    turned: frozenset[str] = frozenset(),
) -> SewnCloth:
    """Join meshes along their seams.

    Args:
        meshed: the pieces.
        fabric: of all pieces.
        placed: by piece where its vertices are designed to lie (#P by 3 [m]); nowhere if not given.
        turned: the pieces that were turned over.
    """
    pieces, meshes, welds = meshed
    begins = {name: rows.start for name, rows in piece_slices({n: m.points for n, m in meshes.items()}).items()}
    pairs = [(begins[a] + i, begins[b] + j) for seam in welds for (a, i), *others in seam for b, j in others]
    cloth = {}
    for name, mesh in meshes.items():
        grain = pieces[name].grain
        along = np.array([0.0, 1.0]) if grain is None else grain[1] - grain[0]
        space = np.zeros((len(mesh.points), 3)) if placed is None else placed[name]
        faces = np.pad(mesh.triangles, ((0, 0), (0, 1)), constant_values=-1)
        cloth[name] = ClothPiece(mesh.points, faces, space, unit(along), {**mesh.lines, **mesh.edges})
    return join_pieces(cloth, *np.array(pairs, dtype=np.int64).reshape(-1, 2).T, fabric=fabric, turned=turned)


def _parts(length: float, spacing: float, finer: int) -> int:
    return max(1, int(np.ceil(finer * length / spacing - 1e-9)))


def _divide(
    seam: Seam,
    edges: Mapping[tuple[str, str], Edge],
    spacing: float,
    finer: int,
    stations: dict[tuple[str, str], FloatArray],
) -> list[list[tuple[str, str, int]]]:
    """Divide both sides of a seam; add the lengths along its edges to `stations`, and return what is joined: piece, edge, number."""
    ends = [
        np.concatenate([[0.0], np.cumsum([edges[side.piece, side.edge].length for side in chain])])
        for chain in seam.sides
    ]
    whole, other = ends[0][-1], ends[1][-1]
    along = np.linspace(0.0, whole, 4001)
    across = eased_length(along, whole, seam.ease, seam.eased)
    across *= other / across[-1]
    breaks = {float(t): (number, -1) for number, t in enumerate(ends[0])}
    for number, t in enumerate(np.interp(ends[1], across, along).tolist()):
        near = min(breaks, key=lambda b: abs(b - t))
        snapped = number in (0, len(ends[1]) - 1) or abs(near - t) < _SNAP * spacing
        breaks[near if snapped else t] = (breaks[near][0] if snapped else -1, number)
    marks = sorted(breaks)
    first = [marks[0]]
    for a, b in pairwise(marks):
        first += np.linspace(a, b, _parts(max(b - a, 1e-9), spacing, finer) + 1)[1:].tolist()
    places = [np.array(first), np.interp(first, along, across)]
    for k, t in enumerate(first):
        if t in breaks and breaks[t][1] >= 0:
            places[1][k] = ends[1][breaks[t][1]]
    joints: list[list[tuple[str, str, int]]] = [[] for _ in first]
    for chain, end, place in zip(seam.sides, ends, places, strict=True):
        for side, (low, high) in zip(chain, pairwise(end), strict=True):
            inside = np.flatnonzero((place >= low - 1e-12) & (place <= high + 1e-12))
            lengths = high - place[inside][::-1] if side.reversed else place[inside] - low
            stations[side.piece, side.edge] = np.clip(lengths, 0.0, high - low)
            for count, k in enumerate(inside.tolist()):
                joints[k].append((side.piece, side.edge, len(inside) - 1 - count if side.reversed else count))
    return joints


def _mesh(
    piece: Piece,
    loops: Sequence[Sequence[Edge]],
    stations: Mapping[str, FloatArray],
    spacing: float,
    fixed: FloatArray,
) -> tuple[FlatMesh, set[str]]:
    """Return the mesh of a piece with vertices at fixed points (#N by 2 [m]), and the edges of which a segment is missing in it."""
    points: list[FloatArray] = []
    ids: dict[str, IntArray] = {}
    rings, count = [], 0
    for loop in loops:
        begin = count
        for edge in loop:
            on_edge = points_at_lengths(edge.points, stations[edge.name])
            points.append(on_edge[:-1])
            ids[edge.name] = np.arange(count, count + len(on_edge), dtype=np.int32)
            count += len(on_edge) - 1
        ids[loop[-1].name][-1] = begin
        rings.append(np.concatenate(points)[begin:])
    polygon = shapely.Polygon(rings[0], rings[1:])
    shapely.prepare(polygon)
    border = np.concatenate(points)
    # The points of a triangular lattice inside a polygon, symmetric about its vertical middle.
    low, high = border.min(axis=0), border.max(axis=0)
    middle, tall = 0.5 * (low[0] + high[0]), spacing * np.sqrt(0.75)
    columns = np.arange(-int((high[0] - low[0]) / spacing) - 1, int((high[0] - low[0]) / spacing) + 2) * spacing
    rows = np.arange(low[1] + 0.5 * tall, high[1], tall)
    found = np.concatenate([np.column_stack([middle + columns + 0.5 * spacing * (k % 2), np.full_like(columns, y)])
                            for k, y in enumerate(rows)])  # fmt: skip
    found = found[shapely.contains_xy(polygon, *found.T)]
    off = shapely.distance(shapely.boundary(polygon), shapely.points(found)) if len(found) else np.empty(0)
    inner = np.asarray(found[off > _OFF_OUTLINE * spacing])
    if len(fixed):
        inner = inner[cKDTree(fixed).query(inner)[0] > _OFF_OUTLINE * spacing]
    everything = np.concatenate([border, inner, fixed])
    simplices = Delaunay(everything).simplices
    corner = everything[simplices]
    area = 0.5 * np.linalg.det(corner[:, 1:] - corner[:, :1])
    simplices[area < 0.0] = simplices[area < 0.0][:, ::-1]
    kept = (np.abs(area) > 1e-6 * spacing**2) & shapely.contains_xy(polygon, *corner.mean(axis=1).T)
    triangles = simplices[kept].astype(np.int32)
    present = {frozenset(pair) for k in range(3) for pair in triangles[:, [k, (k + 1) % 3]].tolist()}
    lost = {name for name, row in ids.items() if any(frozenset(pair) not in present for pair in pairwise(row.tolist()))}
    lines = {}
    if len(inner):
        tree = cKDTree(everything)
        for name, line in piece.internal_lines.items():
            length = polyline_length(line)
            row = tree.query(points_at_lengths(line, np.linspace(0.0, length, max(2, int(length / spacing)))))[1]
            lines[name] = np.asarray(list(dict.fromkeys(row.tolist())), dtype=np.int32)
    return FlatMesh(points=everything, triangles=triangles, edges=ids, lines=lines), lost
