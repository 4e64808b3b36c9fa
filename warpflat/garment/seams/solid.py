"""Closed things, and parts that no tailor's line opens: cut along and across their own axes until each part can lie flat.

What keeps cloth from lying flat is the curvature that it encloses: the area that its normals cover on the unit sphere (Gauss). A part
of that curvature G, of area A and length L is strained by about G A / (12 L^2) when it is laid flat: the curvature over its width
squared. So a narrow gore of a ball lies flat where a cap of the same area does not. Every cut is the one after which the least is
left, over the area.

Where the cloth is known, a part is laid flat before it is cut: what lies flat within its limit is cut no further, whatever the estimate
says, and what is strained at a saddle is. A cut that leaves a narrow part costs more; a neck that is left, too narrow to be sewn, is cut
through. To choose the cut, too, by what lies beyond the limit after it was worse (a plush of 18 % stayed at 18 %), and no better once its
limbs were apart.

Limbs are parted first, where they begin: a toy's ears, arms and feet, a chair's legs, a glove's fingers. The saddles there are what no
halving relieves. What is its own mirror image is cut alike on both sides: in its plane of symmetry, or along lines that mirror each
other. So a toy falls into halves and gussets.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from warpflat.core import FloatArray, IntArray, polyline_length, unit
from warpflat.flat import Surface, border_loops, inner_borders, triangulate
from warpflat.garment.seams.anatomy import HOLE, Anatomy
from warpflat.garment.seams.cloth import ALIKE, SAME_WAY, Cloth, PieceMesh, section
from warpflat.garment.seams.fields import TriangleMesh
from warpflat.garment.seams.symmetric import mirror_image, mirrored

__all__ = [
    "NARROW",
    "OVERLAP",
    "SEWABLE",
    "SOLID",
    "LaidFlat",
    "LayFlat",
    "is_open",
    "is_panel",
    "is_whole_garment",
    "part_solids",
    "parts_within",
]

Ids = NDArray[np.int64]
#: Seams of closed things are called by this word and a number.
SOLID = "seam"

# A part lies flat, or nearly, below this strain by estimate; a ball falls into eight gores by it.
_FLAT = 0.022
# Where it is measured, a part lies flat with less beyond its limit than this share of the whole.
_WORTH = 0.005
#: What lies over itself by no more than this does not [m2].
OVERLAP = 1e-5
# No further cut is made for the shape while less of the whole than this is beyond its limit.
_ENOUGH = 0.03
# A part is narrow that is somewhere less wide than the first share of the size of the whole: nobody cuts a neck of cloth, or a tip, that
# narrow. A cut that leaves one counts as the second strain more, where its width is nothing.
NARROW, _THIN = 0.05, 0.05
#: Nobody sews a neck of cloth narrower than this, half a usual allowance [m].
SEWABLE = 5e-3
# A ring that lacks more than this share of a full turn does not lie flat: its cloth would be stretched by as much.
_CONE = 0.05
# A mesh of fewer faces is too coarse for a garment.
_FEWEST = 60
# Normals, and rings around the ends of limbs, are smoothed over this share of the size: wrinkles and facets are no shape.
_SMOOTH = 0.04
# A cut pays for itself: a seam as long as the part is wide counts as this strain. So does a cut of a round part that leaves parts which
# are not alike, as these are drawn once.
_SEAM = 0.005
# A part is as long along two of its axes within this share: then those of space serve.
_ROUND = 0.05
# Where cloth faces an axis by more than this (cosine) it is a base.
_BASE = 0.6
# The border of a panel squared is at least this share of a disk's; a cap's is shorter.
_PANEL = 0.8
# Limbs are looked for around so many places, far from one another.
_TIPS = 16
# In a limb lies the curvature of half a ball, 2 pi, but for this share of pi; its root is the ring where the second share is lost, and the
# cloth beyond takes all of it but the second share: the toe of a sock is no limb.
_OFF, _LOST = 0.3, 0.5
# The ring around a limb squared is at most this share of a disk's of the limb's area; what is a larger share of the whole is its trunk.
_LIMB, _TRUNK = 0.35, 0.25
# Parts at most, and how many more for each limb.
_MOST, _PER_LIMB = 16, 3
# A part smaller than this share of the whole is not cut further, and is a tip where cloth is taken off all around.
_LEAST = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class LaidFlat:
    """What becomes of a piece that is laid flat.

    Attributes:
        outside: the share beyond its limit.
        overlap: how much of it lies over itself [m2].
        width: where it is narrowest, no more than what nobody calls narrow [m].
        neck: the ends of its narrowest place in space (2 by 3), where it is too narrow there to be sewn, and wider on both sides.
    """

    outside: float
    overlap: float
    width: float
    neck: FloatArray | None = None


#: Lays a piece of a cloth flat; the third argument is the width from which on nothing is narrow [m].
LayFlat = Callable[[Cloth, PieceMesh, float], LaidFlat]


def is_open(mesh: PieceMesh) -> bool:
    """Return whether a piece is a disk, or a tube that one cut opens."""
    return mesh.shape in ((1, 1), (2, 0))


def _wide_borders(cloth: Cloth) -> list[float]:
    """Return the lengths of the borders of a cloth that are no holes [m]."""
    lengths = [polyline_length(cloth.vertices[loop], closed=True) for loop in cloth.loops]
    return [one for one in lengths if one > HOLE * cloth.size]


def is_panel(cloth: Cloth) -> bool:
    """Return whether a cloth is one panel: with one border that is about as long as that of a flat disk of its area, or longer."""
    wide = _wide_borders(cloth)
    return len(wide) == 1 and wide[0] ** 2 >= _PANEL * 4.0 * np.pi * cloth.size**2


def is_whole_garment(surface: Surface) -> bool:
    """Return whether a surface cannot lie flat in one piece: closed, with handles, forked, a cap, or a cone with its tip cut off."""
    if len(surface.faces) < _FEWEST:
        return False
    cloth = Cloth(vertices=surface.vertices, faces=triangulate(surface.faces)[0].astype(np.int64))
    wide = _wide_borders(cloth)
    handles = (2 - sum(cloth.shape)) // 2
    if len(wide) == 2:
        # Between a flat ring and a tube, which is cut open, lies what neither is nor becomes flat, such as a poncho.
        lack = 1.0 + inner_borders(surface)[0][1] / (2.0 * np.pi)
        return handles > 0 or _CONE < lack < 0.5
    return len(wide) != 1 or handles > 0 or not is_panel(cloth)


def part_solids(
    cloth: Cloth,
    *,
    shape: bool,
    mirror: Anatomy | None = None,
    most: int | None = None,
    measure: LayFlat | None = None,
) -> tuple[Cloth, list[str]]:
    """Return the cloth with its pieces cut until each is a disk or a tube, and notes.

    Args:
        cloth: with the seams that it has.
        shape: whether pieces are cut for their shape, too, until each can lie flat.
        mirror: of a cloth that is its own mirror image, vertex by vertex: both sides are cut alike.
        most: pieces at most; 16 if not given, and, with a measure, three more for each limb.
        measure: lays a disk flat; without it all goes by estimate.
    """
    total = float(cloth.face_areas.sum())
    number = 1
    done, known = set[tuple[int, tuple[int, float]]](), dict[int, float]()
    laid = None if measure is None else _remembering(measure, NARROW * np.sqrt(total))
    limbs = 0
    for mesh in list(cloth.pieces()) if shape else ():
        field, count = _limbs(mesh, mirror)
        made = _cut(cloth, mesh, field, f"{SOLID} {number}", mirror) if count else None
        if made is not None:
            cloth, number, limbs = made, number + 1, limbs + count
    if most is None:
        most = _MOST + (0 if laid is None else _PER_LIMB * limbs)
    for _ in range(4 * most):
        beyond = 0.0
        meshes = list(cloth.pieces())
        waiting = []
        for mesh in meshes:
            area = float(cloth.face_areas[mesh.face_of].sum())
            key = _key(mesh, area)
            large, flat = shape and area > _LEAST * total, None
            # What has no pattern, or one that nobody can sew, comes first and last; how many pieces there are is no matter. A pattern has
            # holes, yet sews nothing into them.
            if not is_open(mesh) or any(
                turn <= -np.pi and np.isin(mesh.vertex_of[loop], cloth.seam_edges()).all()
                for loop, turn in inner_borders(mesh.as_surface())
            ):
                rank, value = 2, _strain(mesh, known) * area
            elif laid is not None and mesh.is_disk:
                flat = laid(cloth, mesh)
                beyond += flat.outside * area
                rank, value = (2, flat.overlap) if flat.overlap > OVERLAP else (1, flat.outside * area - _WORTH * total)
            else:
                rank, value = 1, (_strain(mesh, known) - _FLAT) * area
                beyond += area if value > 0.0 else 0.0
            if rank == 1 and (not large or len(meshes) >= most or value <= 0.0 or (1, key) in done):
                rank = 0
            if rank == 0 and (not large or flat is None or flat.neck is None):
                continue
            if (rank, key) not in done:
                waiting.append((rank, value, key, mesh))
        if beyond < _ENOUGH * total:
            waiting = [one for one in waiting if one[0] != 1]
        if not waiting:
            break
        rank, _, key, mesh = max(waiting, key=lambda one: one[:2])
        neck = laid(cloth, mesh).neck if laid is not None and rank == 0 else None
        way = _best_way(mesh, total, known, mirror, laid, neck)
        made = None if way is None else _cut(cloth, mesh, way, f"{SOLID} {number}", mirror)
        if made is None:
            done.add((rank, key))
        else:
            cloth, number = made, number + 1
    notes = list[str]()
    for mesh in list(cloth.pieces()):
        edges = _around_handles(mesh)
        if len(edges):
            cloth, number = cloth.with_seam(f"{SOLID} {number}", mesh.vertex_of[edges]), number + 1
            x, y, z = (100.0 * mesh.vertices[edges].mean(axis=(0, 1))).tolist()
            notes.append(
                f"a piece has handles, as where a lace lies on it: slit open there, about ({x:.0f}, {y:.0f}, {z:.0f}) cm"
            )
    left = sum(not is_open(mesh) for mesh in cloth.pieces())
    notes += [f"{left} of its pieces have several holes that no cut has opened"] if left else []
    return cloth, notes


def _around_handles(mesh: PieceMesh) -> Ids:
    """Return the edges (#E by 2) along which a piece with a border is slit, so that it has no handle: shortest ways around them.

    Of all edges that neither a tree of shortest ways to the border nor a tree of faces uses, two for each handle are left. Each closes
    a way around it with those of its ends (Erickson and Whittlesey, "Greedy optimal homotopy and homology generators", 2005).
    """
    loops, count = mesh.loops, len(mesh.vertices)
    if not loops or sum(mesh.shape) == 2:
        return np.empty((0, 2), np.int64)
    he = mesh.half_edges
    a, b = he.edges.T.astype(np.int64)
    length = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)
    far, before, _ = dijkstra(mesh.graph, directed=False, indices=loops[0], min_only=True, return_predecessors=True)
    inner = np.flatnonzero(before >= 0)
    key = a * count + b
    ways = np.minimum(inner, before[inner]) * count + np.maximum(inner, before[inner])
    around = far[a] + far[b] + length
    # Beside each edge lie two faces, or a face and a hole; the border to which the ways lead has none beside it.
    hole = np.full(count, -1)
    for number, loop in enumerate(loops):
        hole[loop] = number
    beside = np.full((len(a), 2), -1)
    order = np.argsort(he.edge, kind="stable")
    first = np.searchsorted(he.edge[order], np.arange(len(a)))
    beside[:, 0] = he.face[order][first]
    double = he.count == 2
    beside[double, 1] = he.face[order][first[double] + 1]
    beside[~double, 1] = np.where(hole[a[~double]] > 0, len(mesh.faces) + hole[a[~double]], -1)
    free = np.flatnonzero((beside[:, 1] >= 0) & ~np.isin(key, ways))
    # Of several edges between the same two the one with the longest way.
    free = free[np.argsort(-around[free], kind="stable")]
    pairs = np.sort(beside[free], axis=1)
    _, chosen = np.unique(pairs, axis=0, return_index=True)
    weight = 1.0 + around.max() - around[free[chosen]]
    size = len(mesh.faces) + len(loops)
    spanning = minimum_spanning_tree(coo_array((weight, tuple(pairs[chosen].T)), shape=(size, size)).tocsr()).tocoo()
    used = np.isin(pairs[chosen] @ [size, 1], spanning.row.astype(np.int64) * size + spanning.col)
    left = np.setdiff1d(free, free[chosen[used]])
    found = {(int(a[edge]), int(b[edge])) for edge in left}
    for vertex in np.unique(he.edges[left]).tolist():
        while before[vertex] >= 0:
            found.add((min(vertex, int(before[vertex])), max(vertex, int(before[vertex]))))
            vertex = int(before[vertex])
    border = set(zip(a[~double].tolist(), b[~double].tolist(), strict=True))
    return np.array(sorted(found - border), np.int64).reshape(-1, 2)


def _cut(cloth: Cloth, mesh: PieceMesh, field: FloatArray, name: str, mirror: Anatomy | None) -> Cloth | None:
    """Return the cloth with a piece, and its mirror image, cut along a field's zero line (#V of the piece); None if it is not parted."""
    own, way = cloth.marked(mesh.face_of), np.zeros(len(cloth.vertices))
    way[mesh.vertex_of] = field
    keep = 0.01
    for other in cloth.pieces() if mirror is not None else ():
        image = None if mirror is None or other.face_of[0] == mesh.face_of[0] else mirror_image(other, mesh, mirror)
        if image is not None:
            own[other.face_of], way[other.vertex_of] = True, field[image]
            # Of both together, an island is half the share.
            keep *= 0.5
            break
    made, _, _, edges = cloth.parted(way, own, keep=keep)
    made = made.with_seam(name, edges)
    if mirror is not None:
        # Vertices that moved onto the line have moved alike on both sides.
        made, _ = mirrored(made, mirror)
    return made if int(made.parts.max()) > int(cloth.parts.max()) else None


def _strain(mesh: PieceMesh, known: dict[int, float]) -> float:
    """Return about how much a mesh is strained when it is laid flat; `known` remembers it by the hash of its corners."""
    corners = hash(mesh.vertices[mesh.faces].tobytes())
    if corners in known:
        return known[corners]
    normals = _smoothed_normals(mesh)[mesh.faces]
    a, b, c = normals.transpose(1, 0, 2)
    # The solid angle of a triangle of unit vectors, for small ones the triangle's own area.
    curvature = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    # Between two places that are about as far from each other as any, the way along the mesh.
    far = dijkstra(mesh.graph, directed=False, indices=0)
    far = dijkstra(mesh.graph, directed=False, indices=int(np.where(np.isfinite(far), far, -1.0).argmax()))
    area, length = float(mesh.face_areas.sum()), float(far[np.isfinite(far)].max())
    for loop in mesh.loops[1:2]:
        # A tube is as long, laid flat, as it is around.
        length = max(length, polyline_length(mesh.vertices[loop], closed=True))
    known[corners] = curvature * area / (12.0 * max(length, 1e-300) ** 2)
    return known[corners]


def _limbs(mesh: PieceMesh, mirror: Anatomy | None) -> tuple[FloatArray, int]:
    """Return a field (#V) that is positive on the limbs of a part: its ears, legs, fingers, and how many there are.

    Rings around a place far out enclose more and more curvature: 2 pi, that of half a ball, at the end of a limb and all along it. Where
    the limb begins the cloth is a saddle, and takes it away again: to 0 on a trunk that is flat (Gauss and Bonnet).
    """
    size, curvature = mesh.size, mesh.curvature
    rim = np.unique(mesh.border_edges)
    tips = [int(np.linalg.norm(mesh.vertices - mesh.vertices.mean(axis=0), axis=1).argmax())]
    away = dijkstra(mesh.graph, directed=False, indices=tips[0])
    while len(tips) < _TIPS:
        tips.append(int(np.where(np.isfinite(away), away, -1.0).argmax()))
        away = np.minimum(away, dijkstra(mesh.graph, directed=False, indices=tips[-1]))
    heat = np.zeros((len(curvature), _TIPS))
    heat[tips, np.arange(_TIPS)] = 1.0 / mesh.mass[tips]
    whole = Cloth(vertices=mesh.vertices, faces=mesh.faces)
    found = list[tuple[float, int, FloatArray]]()
    for tip, warm in zip(tips, mesh.smooth(heat, _SMOOTH * size).T, strict=True):
        # Varadhan's formula: how heat spreads is how far it is.
        far = -_SMOOTH * size * np.log(np.maximum(warm, 1e-300))
        order = np.argsort(far)
        inside = np.cumsum(curvature[order])[: int(np.isin(order, rim).argmax()) if len(rim) else None] / np.pi
        grown = np.flatnonzero(inside > 2.0 - _OFF)
        lost = grown[0] + np.flatnonzero(inside[grown[0] :] < 2.0 - _LOST) if len(grown) else grown
        if len(lost) == 0 or inside[lost[0] :].min() > _LOST or np.abs(inside[: lost[0]] - 1.0).max() > 1.0 + _OFF:
            continue
        field = far[order[lost[0]]] - far
        length = section(whole, field, np.ones(len(mesh.faces), dtype=bool))[0]
        area = float(mesh.mass[order[: lost[0]]].sum())
        ratio = length**2 / (4.0 * np.pi * area)
        if ratio < _LIMB and 0.3 * _LEAST < area / size**2 < _TRUNK:
            found.append((ratio, tip, field))
    image = None if mirror is None else mirror_image(mesh, mesh, mirror)
    taken, count = np.full(len(curvature), -np.inf), 0
    for _, tip, field in sorted(found, key=lambda one: one[0]):
        if taken[tip] > 0.0:
            continue
        # Limbs stand apart: what is beside one belongs to no other.
        beside = np.unique(mesh.faces[(taken > 0.0)[mesh.faces].any(axis=1)])
        field = field - max(float(field[beside].max(initial=0.0)), 0.0)
        count += 1
        if image is not None:
            count += int(field[image[tip]] <= 0.0)
            field = np.maximum(field, field[image])
        taken = np.maximum(taken, field)
    return taken, count


def _smoothed_normals(mesh: TriangleMesh) -> FloatArray:
    """Return the normals of the vertices (#V by 3), smoothed."""
    return unit(mesh.smooth(mesh.vertex_normals, _SMOOTH * mesh.size))


def _ways(mesh: PieceMesh, mirror: Anatomy | None) -> tuple[list[FloatArray], bool]:
    """Return ways of cutting a part: across each of its axes through the middle, and where it begins to face each way along them.

    Each is a field (#V), positive on one side. With them comes whether the part is round about an axis, and can fall into equal ones.
    With `mirror` it is its own mirror image: an axis that nearly is across the plane of symmetry is taken as that, and cut in the plane.
    """
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    share = mesh.face_areas / mesh.face_areas.sum()
    centre = share @ middles
    values, vectors = np.linalg.eigh(((middles - centre) * share[:, None]).T @ (middles - centre))
    axes = vectors.T
    same = values[1:] <= (1.0 + _ROUND) * values[:-1]
    if same.all():
        axes = np.eye(3)
    elif same.any():
        # Round about one of its axes: the axis of space that is the farthest from that one, and the one at right angles to both.
        own = axes[2 if same[0] else 0]
        other = np.eye(3)[np.abs(own).argmin()]
        other = unit(other - (other @ own) * own)
        round_ones = [other, np.cross(own, other)]
        axes = np.array([*round_ones, own] if same[0] else [own, *round_ones])
    # Axes that nearly are those of space are taken as these: a garment is drawn upright.
    axes = np.array(
        [
            np.sign(axis[np.abs(axis).argmax()]) * np.eye(3)[np.abs(axis).argmax()]
            if np.abs(axis).max() > SAME_WAY
            else axis
            for axis in axes
        ]
    )
    fields = (mesh.vertices - centre) @ axes.T
    if mirror is not None:
        k = int(np.abs(axes @ mirror.normal).argmax())
        if abs(float(axes[k] @ mirror.normal)) > SAME_WAY:
            axes[k], fields[:, k] = mirror.normal, mesh.vertices @ mirror.normal - mirror.offset
    # To the nanometre: on which side a vertex in the plane of symmetry lies is not for rounding to say.
    fields = np.round(fields, 9)
    ways = [fields[:, k] for k in (1, 2, 0)]
    normals = _smoothed_normals(mesh)[mesh.faces].mean(axis=1)
    for axis in axes:
        weight = np.repeat(mesh.face_areas * (normals @ axis) / 3.0, 3)
        facing = np.bincount(mesh.faces.ravel(), weight, minlength=len(mesh.vertices)) / mesh.mass
        ways += [facing - _BASE, -facing - _BASE]
    return ways, bool(same.any())


def _key(mesh: PieceMesh, area: float) -> tuple[int, float]:
    """Return what a piece and its mirror image have in common."""
    return len(mesh.face_of), round(area, 9)


def _remembering(measure: LayFlat, width: float) -> Callable[[Cloth, PieceMesh], LaidFlat]:
    """Return a measure that lays pieces that are alike flat once."""
    known: dict[tuple[int, float], LaidFlat] = {}

    def laid(cloth: Cloth, mesh: PieceMesh) -> LaidFlat:
        key = _key(mesh, float(cloth.face_areas[mesh.face_of].sum()))
        if key not in known:
            known[key] = measure(cloth, mesh, width)
        return known[key]

    return laid


def _best_way(
    mesh: PieceMesh,
    total: float,
    known: dict[int, float],
    mirror: Anatomy | None,
    laid: Callable[[Cloth, PieceMesh], LaidFlat] | None,
    neck: FloatArray | None,
) -> FloatArray | None:
    """Return the field (#V) along whose zero line a part is cut so that the least is left to do; None if no cut parts it well."""
    image = None if mirror is None else mirror_image(mesh, mesh, mirror)
    found = list[tuple[float, Cloth, FloatArray]]()
    ways, is_round = _ways(mesh, None if image is None else mirror)
    if neck is not None:
        # At its neck and nowhere else, in the plane through the neck's ends at right angles to the cloth.
        middle, points, normals = neck.mean(axis=0), mesh.vertices, mesh.area_vectors
        away = np.linalg.norm(points[mesh.faces].mean(axis=1) - middle, axis=1)
        near = away < max(np.linalg.norm(neck[1] - neck[0]), 2e-3)
        along = np.cross(neck[1] - neck[0], normals[near].sum(axis=0) if near.any() else normals.sum(axis=0))
        field = (points - middle) @ unit(along)
        # Of what lies beyond the plane, only the part at the neck.
        ahead = np.flatnonzero(field > 0.0)
        if len(ahead):
            first = ahead[np.linalg.norm(points[ahead] - middle, axis=1).argmin()]
            field = np.where(mesh.reached(field > 0.0, np.array([first])), field, -np.abs(field))
        ways = [field]
    for field in ways:
        way = field
        if image is not None:
            other = field[image]
            alike = abs(float(field @ other)) > SAME_WAY * float(np.linalg.norm(field) * np.linalg.norm(other))
            if neck is None and not alike:
                continue
            if not alike:
                # At both of its necks.
                way = np.maximum(field, other)
        local = Cloth(vertices=mesh.vertices, faces=mesh.faces)
        made, _, _, edges = local.parted(way, np.ones(len(local.faces), dtype=bool), keep=0.05)
        if len(edges) == 0:
            continue
        made = made.with_seam("way", edges)
        parts = list(made.pieces())
        areas = [float(made.face_areas[part.face_of].sum()) for part in parts]
        if len(parts) == 1 or min(areas) < 0.3 * _LEAST * total:
            continue
        # A part that is no disk costs more: a tube needs one more cut, anything else several.
        shapes = [part.shape for part in parts]
        undone = sum(0.01 * min(1 - euler, 1) + 0.2 * max(-euler, 0) if loops else 1.0 for loops, euler in shapes)
        cost = _SEAM * made.seam_length("way") / np.sqrt(sum(areas)) + undone
        cost += _SEAM * (neck is None and is_round) * (max(areas) > (1.0 + ALIKE) * min(areas))
        cost += sum(_strain(part, known) * area for part, area in zip(parts, areas, strict=True)) / sum(areas)
        found.append((cost, made, way))
    best: tuple[float, FloatArray] | None = None
    for cost, made, field in sorted(found, key=lambda one: one[0]):
        if best is not None and best[0] <= cost:
            break
        if laid is not None:
            disks = [laid(made, part) for part in made.pieces() if part.is_disk]
            # What lies over itself has no width: where it is narrowest hangs on rounding.
            widths = [flat.width for flat in disks if flat.overlap <= OVERLAP]
            cost += _THIN * max(1.0 - min(widths, default=np.inf) / (NARROW * np.sqrt(total)), 0.0)
        if best is None or cost < best[0]:
            best = cost, field
    return None if best is None else best[1]


def parts_within(faces: IntArray, flat: FloatArray, width: float, tip: float = _LEAST) -> int:
    """Return in how many parts a pattern falls with half a width [m] taken off all around; 0 where nothing is left.

    Tips, which are no more than a share of the whole, are no parts.
    """
    import shapely

    rings = [shapely.Polygon(flat[loop]).buffer(0.0) for loop in border_loops(faces, flat)]
    whole = rings[0].difference(shapely.union_all(rings[1:]))
    return int((shapely.area(shapely.get_parts(whole.buffer(-0.5 * width))) > tip * whole.area).sum())
